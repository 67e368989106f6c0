/* Writes down what a process does to the files under $RECORD_ROOT, in order, into $RECORD_LOG.

   It also lets the disk fill (record_fill): what would take room then answers ENOSPC, after half of
   the first write.

   Preloaded into a process (LD_PRELOAD): each call that changes files is passed on to the C library
   and noted, one at a time. Read back by tests/helpers/power.py. What is mapped into memory is not
   seen: SQLite maps its index of the write-ahead log alone, which it makes anew after a crash. */
#define _GNU_SOURCE
#include <dlfcn.h>
#include <errno.h>
#include <fcntl.h>
#include <pthread.h>
#include <stdarg.h>
#include <stdint.h>
#include <stdio.h>
#include <stdlib.h>
#include <string.h>
#include <sys/stat.h>
#include <sys/types.h>
#include <sys/uio.h>
#include <unistd.h>

static pthread_mutex_t lock = PTHREAD_MUTEX_INITIALIZER;
static int log_fd = -1;

#define REAL(name) ((__typeof__(&name))dlsym(RTLD_NEXT, #name))

static int is_under(const char *path) {
    const char *root = getenv("RECORD_ROOT");
    if (!root || !path) return 0;
    size_t n = strlen(root);
    return strncmp(path, root, n) == 0 && (path[n] == '/' || path[n] == 0);
}

static void absolute(int at, const char *path, char *out) {
    if (path[0] == '/') { snprintf(out, 4096, "%s", path); return; }
    char base[3000], link[64];
    if (at == AT_FDCWD) {
        if (!getcwd(base, sizeof base)) base[0] = 0;
    } else {
        snprintf(link, sizeof link, "/proc/self/fd/%d", at);
        ssize_t n = readlink(link, base, sizeof base - 1);
        base[n < 0 ? 0 : n] = 0;
    }
    snprintf(out, 4096, "%.3000s/%.1000s", base, path);
}

static int of_descriptor(int fd, char *out) {
    char link[64];
    snprintf(link, sizeof link, "/proc/self/fd/%d", fd);
    ssize_t n = readlink(link, out, 4095);
    out[n < 0 ? 0 : n] = 0;
    return is_under(out);
}

static uint64_t inode_of(int fd) {
    struct stat s;
    return fstat(fd, &s) ? 0 : s.st_ino;
}

static void put(const void *data, size_t n) {
    const char *at = data;
    while (n) {
        ssize_t done = REAL(write)(log_fd, at, n);
        if (done <= 0) abort();
        at += done; n -= done;
    }
}

static void note(char kind, uint64_t inode, uint64_t number, const void *a, uint32_t na,
                 const void *b, uint32_t nb) {
    int before = errno;
    if (log_fd < 0) {
        const char *name = getenv("RECORD_LOG");
        log_fd = REAL(open)(name, O_WRONLY | O_CREAT | O_APPEND | O_CLOEXEC, 0644);
        if (log_fd < 0) abort();
    }
    put(&kind, 1); put(&inode, 8); put(&number, 8); put(&na, 4); put(&nb, 4);
    put(a, na); put(b, nb);
    errno = before;
}

void record_mark(const char *text) {
    pthread_mutex_lock(&lock);
    note('K', 0, 0, text, strlen(text), "", 0);
    pthread_mutex_unlock(&lock);
}

static long asked = 0, full_from = 0, full_until = 0;

/* From the n-th call that takes room, counted from now, until another the disk is full. */
void record_fill(long from, long until) { asked = 0; full_from = from; full_until = until; }

/* How many calls have taken or asked for room since. */
long record_asked(void) { return asked; }

static int is_full(void) {
    asked++;
    return full_from && asked >= full_from && asked < full_until;
}
#define REFUSED (errno = ENOSPC, pthread_mutex_unlock(&lock), -1)

/* How much of a write the disk still takes. */
static size_t room_for(size_t n) {
    if (!is_full()) return n;
    return asked == full_from ? n / 2 : 0;
}

static int opened(int at, const char *path, int flags, mode_t mode) {
    char full[4096];
    absolute(at, path, full);
    if (!is_under(full) || !(flags & (O_CREAT | O_TRUNC)))
        return REAL(openat)(at, path, flags, mode);
    pthread_mutex_lock(&lock);
    struct stat s;
    int is_new = lstat(full, &s) != 0;
    if (is_new && is_full()) return REFUSED;
    int fd = REAL(openat)(at, path, flags, mode);
    if (fd >= 0 && (is_new || (flags & O_TRUNC)))
        note('C', inode_of(fd), is_new, full, strlen(full), "", 0);
    pthread_mutex_unlock(&lock);
    return fd;
}

#define MODE(flags, after) \
    mode_t mode = 0; \
    if ((flags) & (O_CREAT | O_TMPFILE)) { va_list rest; va_start(rest, after); mode = va_arg(rest, mode_t); va_end(rest); }

int open(const char *path, int flags, ...) { MODE(flags, flags); return opened(AT_FDCWD, path, flags, mode); }
int open64(const char *path, int flags, ...) { MODE(flags, flags); return opened(AT_FDCWD, path, flags | O_LARGEFILE, mode); }
int openat(int at, const char *path, int flags, ...) { MODE(flags, flags); return opened(at, path, flags, mode); }
int openat64(int at, const char *path, int flags, ...) { MODE(flags, flags); return opened(at, path, flags, mode); }

ssize_t write(int fd, const void *data, size_t n) {
    char full[4096];
    if (!of_descriptor(fd, full)) return REAL(write)(fd, data, n);
    pthread_mutex_lock(&lock);
    if (n && !(n = room_for(n))) return REFUSED;
    off_t at = fcntl(fd, F_GETFL) & O_APPEND ? lseek(fd, 0, SEEK_END) : lseek(fd, 0, SEEK_CUR);
    ssize_t done = REAL(write)(fd, data, n);
    if (done > 0) note('W', inode_of(fd), at, data, done, "", 0);
    pthread_mutex_unlock(&lock);
    return done;
}

static ssize_t written(int fd, const void *data, size_t n, off_t at) {
    char full[4096];
    if (!of_descriptor(fd, full)) return REAL(pwrite)(fd, data, n, at);
    pthread_mutex_lock(&lock);
    if (n && !(n = room_for(n))) return REFUSED;
    ssize_t done = REAL(pwrite)(fd, data, n, at);
    if (done > 0) note('W', inode_of(fd), at, data, done, "", 0);
    pthread_mutex_unlock(&lock);
    return done;
}
ssize_t pwrite(int fd, const void *data, size_t n, off_t at) { return written(fd, data, n, at); }
ssize_t pwrite64(int fd, const void *data, size_t n, off64_t at) { return written(fd, data, n, at); }

static int cut(int fd, off_t size) {
    char full[4096];
    if (!of_descriptor(fd, full)) return REAL(ftruncate)(fd, size);
    pthread_mutex_lock(&lock);
    int result = REAL(ftruncate)(fd, size);
    if (!result) note('T', inode_of(fd), size, "", 0, "", 0);
    pthread_mutex_unlock(&lock);
    return result;
}
int ftruncate(int fd, off_t size) { return cut(fd, size); }
int ftruncate64(int fd, off64_t size) { return cut(fd, size); }

static int synced(int fd, int (*real)(int)) {
    char full[4096];
    if (!of_descriptor(fd, full)) return real(fd);
    pthread_mutex_lock(&lock);
    int result = real(fd);
    if (!result) note('S', inode_of(fd), 0, full, strlen(full), "", 0);
    pthread_mutex_unlock(&lock);
    return result;
}
int fsync(int fd) { return synced(fd, REAL(fsync)); }
int fdatasync(int fd) { return synced(fd, REAL(fdatasync)); }

#define TWO(kind, call, at1, path1, at2, path2) \
    char one[4096], two[4096]; \
    absolute(at1, path1, one); absolute(at2, path2, two); \
    if (!is_under(one) && !is_under(two)) return call; \
    pthread_mutex_lock(&lock); \
    if (is_full()) return REFUSED; \
    int result = call; \
    if (!result) note(kind, 0, 0, one, strlen(one), two, strlen(two)); \
    pthread_mutex_unlock(&lock); \
    return result;
#define ONE(kind, call, at1, path1) \
    char one[4096]; \
    absolute(at1, path1, one); \
    if (!is_under(one)) return call; \
    pthread_mutex_lock(&lock); \
    if ((kind) == 'M' && is_full()) return REFUSED; \
    int result = call; \
    if (!result) note(kind, 0, 0, one, strlen(one), "", 0); \
    pthread_mutex_unlock(&lock); \
    return result;

int rename(const char *a, const char *b) { TWO('R', REAL(rename)(a, b), AT_FDCWD, a, AT_FDCWD, b) }
int renameat(int x, const char *a, int y, const char *b) { TWO('R', REAL(renameat)(x, a, y, b), x, a, y, b) }
int link(const char *a, const char *b) { TWO('L', REAL(link)(a, b), AT_FDCWD, a, AT_FDCWD, b) }
int linkat(int x, const char *a, int y, const char *b, int f) { TWO('L', REAL(linkat)(x, a, y, b, f), x, a, y, b) }
int unlink(const char *a) { ONE('U', REAL(unlink)(a), AT_FDCWD, a) }
int unlinkat(int x, const char *a, int f) { ONE(f & AT_REMOVEDIR ? 'D' : 'U', REAL(unlinkat)(x, a, f), x, a) }
int mkdir(const char *a, mode_t m) { ONE('M', REAL(mkdir)(a, m), AT_FDCWD, a) }
int mkdirat(int x, const char *a, mode_t m) { ONE('M', REAL(mkdirat)(x, a, m), x, a) }
int rmdir(const char *a) { ONE('D', REAL(rmdir)(a), AT_FDCWD, a) }
