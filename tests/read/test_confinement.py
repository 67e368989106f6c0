"""What a reading child that was taken over tries, each by itself, within the bounds of every child.

A probe counts as refused where the system says "not permitted", "denied" or "no such call": any
other error means that the call reached the kernel's own code. They are tried with a file that the
child reads only, and with a packed one, for which it has a folder to write in.
"""

from __future__ import annotations

import platform
import re
import sys
from collections.abc import Iterator
from dataclasses import dataclass
from pathlib import Path

import pytest

from shm.errors import BadInput, ShmError
from shm.read import FORMATS, sandbox
from shm.read.sandbox import confinement
from shm.values import Recording
from tests.helpers.taken_over import obey, obeying_readers
from tests.helpers.written import write

pytestmark = pytest.mark.skipif(
    sys.platform != "linux" or platform.machine() not in confinement.CALLS,
    reason="only Linux lets a process confine itself, and we know the calls of these two",
)

# asm/unistd_64.h and asm-generic/unistd.h
NUMBERS = {
    "add_key": (248, 217), "bpf": (321, 280), "capset": (126, 91), "chroot": (161, 51),
    "clone": (56, 220), "execveat": (322, 281), "fanotify_init": (300, 262),
    "fchmodat": (268, 53), "fchmodat2": (452, 452), "inotify_init1": (294, 26),
    "io_uring_setup": (425, 425), "ioprio_set": (251, 30), "keyctl": (250, 219),
    "memfd_create": (319, 279), "mount": (165, 40), "mq_open": (240, 180), "msgget": (68, 186),
    "openat2": (437, 437), "perf_event_open": (298, 241), "personality": (135, 92),
    "pidfd_getfd": (438, 438), "pidfd_open": (434, 434), "pivot_root": (155, 41),
    "prctl": (157, 167), "prlimit64": (302, 261), "process_vm_readv": (310, 270),
    "process_vm_writev": (311, 271), "ptrace": (101, 117), "renameat2": (316, 276),
    "rt_sigqueueinfo": (129, 138), "seccomp": (317, 277), "semget": (64, 190),
    "setns": (308, 268), "shmget": (29, 194), "syslog": (103, 116),
    "tgkill": (234, 131), "tkill": (200, 130), "umount2": (166, 39), "unshare": (272, 97),
    "userfaultfd": (323, 282), "utimensat": (280, 88),
}  # fmt: skip

PRELUDE = f"""
import ctypes, socket
at = 0 if os.uname().machine == 'x86_64' else 1
libc, numbers, HERE = ctypes.CDLL(None, use_errno=True), {NUMBERS!r}, -100
parent, own, victim = os.getppid(), os.getpid(), path.parent / 'victim'
def call(name, *arguments):
    if libc.syscall(ctypes.c_long(numbers[name][at]), *arguments) < 0:
        raise OSError(ctypes.get_errno(), name)
def mine():
    return os.open(path, os.O_RDONLY)
here, there = bytes(path), bytes(victim)
"""

PROBES = {
    # files
    "append to another file": "open(victim, 'a')",
    "make a file": "open(path.parent / 'new', 'x')",
    "make a file without a name": "os.open(path.parent, os.O_TMPFILE | os.O_RDWR)",
    "empty another file by opening it": "os.open(victim, os.O_RDONLY | os.O_TRUNC)",
    "open the own file to write": "os.open(path, os.O_RDWR)",
    "open by openat2": "call('openat2', HERE, there, bytes(24), 24)",
    "unlink": "os.unlink(victim)",
    "unlink the own file": "os.unlink(path)",
    "rename": "os.rename(victim, path.parent / 'new')",
    "renameat2": "call('renameat2', HERE, there, HERE, here, 2)",
    "chmod": "os.chmod(victim, 0o777)",
    "chmod of the own file": "os.chmod(path, 0o777)",
    "fchmod": "os.fchmod(mine(), 0o777)",
    "fchmodat": "call('fchmodat', HERE, there, 0o777)",
    "fchmodat2": "call('fchmodat2', HERE, there, 0o777, 0)",
    "utimensat": "os.utime(victim)",
    "utimensat of a descriptor": "os.utime(mine())",
    "chown": "os.chown(victim, 1, 1)",
    "fchown": "os.fchown(mine(), 1, 1)",
    "lchown": "os.lchown(victim, 1, 1)",
    "truncate": "os.truncate(victim, 0)",
    "symlink": "os.symlink('/etc', path.parent / 'new')",
    "link": "os.link(victim, path.parent / 'new')",
    "mkfifo": "os.mkfifo(path.parent / 'new')",
    "mknod of a device": "os.mknod(path.parent / 'new', 0o020666, os.makedev(1, 3))",
    "mkdir": "os.mkdir(path.parent / 'new')",
    "rmdir": "os.rmdir(path.parent / 'folder')",
    "setxattr": "os.setxattr(path, 'user.shm', b'1')",
    "fsetxattr": "os.setxattr(mine(), 'user.shm', b'1')",
    "removexattr": "os.removexattr(path, 'user.shm')",
    "flock": "import fcntl; fcntl.flock(mine(), fcntl.LOCK_EX)",
    "lock of a range": "import fcntl; fcntl.lockf(mine(), fcntl.LOCK_SH)",
    "lease": "import fcntl; fcntl.fcntl(mine(), fcntl.F_SETLEASE, fcntl.F_RDLCK)",
    "fallocate": "os.posix_fallocate(mine(), 0, 1 << 20)",
    "sync": "os.fsync(mine())",
    # what is nobody's to read
    "read /etc/passwd": "open('/etc/passwd').read()",
    "read a key in the home folder": "open(path.parent / 'home/.ssh/id_ed25519').read()",
    "read the store": "open(path.parent / 'shm.db', 'rb').read()",
    "read another recording": "open(victim).read()",
    "list the folder": "os.listdir(path.parent)",
    "read the parent's memory": "open(f'/proc/{parent}/mem', 'rb').read(1)",
    "read the parent's environment": "open(f'/proc/{parent}/environ').read()",
    "read the parent's command line": "open(f'/proc/{parent}/cmdline').read()",
    "write the own memory": "open('/proc/self/mem', 'r+b')",
    "change the own OOM score": "open('/proc/self/oom_score_adj', 'w')",
    # network and messages
    **{
        f"socket {family}": f"socket.socket({number}, {kind})"
        for family, number, kind in (
            ("unix", 1, 1), ("inet", 2, 1), ("inet udp", 2, 2), ("inet raw", 2, 3),
            ("inet6", 10, 1), ("netlink", 16, 3), ("packet", 17, 3), ("alg", 38, 5),
            ("bluetooth", 31, 5), ("vsock", 40, 1), ("xdp", 44, 3),
        )
    },
    "socketpair": "socket.socketpair()",
    "io_uring": "call('io_uring_setup', 4, bytes(120))",
    "shmget": "call('shmget', 0, 4096, 0o1600)",
    "msgget": "call('msgget', 0, 0o1600)",
    "semget": "call('semget', 0, 1, 0o1600)",
    "mq_open": "call('mq_open', b'shm', os.O_CREAT | os.O_RDWR, 0o600, None)",
    "push a key into the terminal": "import fcntl; fcntl.ioctl(0, 0x5412, b'x')",
    "have signals sent by a pipe": "import fcntl; fcntl.fcntl(0, fcntl.F_SETOWN, parent)",
    # other processes
    "kill of the parent": "os.kill(parent, 0)",
    "kill of all": "os.kill(-1, 0)",
    "kill of the own group": "os.kill(0, 0)",
    "tgkill of the parent": "call('tgkill', parent, parent, 0)",
    "tkill": "call('tkill', parent, 0)",
    "rt_sigqueueinfo": "call('rt_sigqueueinfo', parent, 0, bytes(128))",
    "pidfd_open": "call('pidfd_open', parent, 0)",
    "pidfd_getfd": "call('pidfd_getfd', 0, 0, 0)",
    "ptrace": "call('ptrace', 16, parent, 0, 0)",
    "process_vm_readv": "call('process_vm_readv', parent, bytes(16), 1, bytes(16), 1, 0)",
    "process_vm_writev": "call('process_vm_writev', parent, bytes(16), 1, bytes(16), 1, 0)",
    "prlimit on the parent": "call('prlimit64', parent, 7, bytes(16), None)",
    "a look at the parent's limits": "call('prlimit64', parent, 7, None, bytes(16))",
    "other limits for itself": "call('prlimit64', 0, 7, bytes(16), None)",
    "priority of the parent": "os.setpriority(os.PRIO_PROCESS, parent, 19)",
    "priority of its input and output": "call('ioprio_set', 1, parent, 0x6000)",
    "processors of the parent": "os.sched_setaffinity(parent, {0})",
    "a session of its own": "os.setsid()",
    "a group of its own": "os.setpgid(0, 0)",
    # new processes, programs, worlds
    "fork": "os.fork()",
    "clone": "call('clone', 17, 0, 0, 0, 0)",
    "clone into new namespaces": "call('clone', 0x10020011, 0, 0, 0, 0)",
    "a thread": "import _thread; _thread.start_new_thread(print, ())",
    "execve": "os.execv('/bin/true', ['true'])",
    "execveat": "call('execveat', HERE, b'/bin/true', None, None, 0)",
    "memfd_create": "os.execve(os.memfd_create('x'), ['x'], {})",
    "unshare": "call('unshare', 0x10000000)",
    "setns": "call('setns', mine(), 0)",
    "mount": "call('mount', b'none', there, b'tmpfs', 0, None)",
    "umount": "call('umount2', there, 0)",
    "chroot": "os.chroot(path.parent)",
    "pivot_root": "call('pivot_root', here, here)",
    "setuid": "os.setuid(os.getuid())",
    "setgroups": "os.setgroups([])",
    "capset": "call('capset', bytes(8), None)",
    # the kernel
    "bpf": "call('bpf', 0, bytes(64), 64)",
    "perf_event_open": "call('perf_event_open', bytes(128), 0, -1, -1, 0)",
    "keyctl": "call('keyctl', 0, -3, 0)",
    "add_key": "call('add_key', b'user', b'shm', b'1', 1, -2)",
    "userfaultfd": "call('userfaultfd', 1)",
    "fanotify": "call('fanotify_init', 0, 0)",
    "inotify": "call('inotify_init1', 0)",
    "prctl": "call('prctl', 4, 1, 0, 0, 0)",
    "personality": "call('personality', 0x40000)",
    "another filter": "call('seccomp', 1, 0, None)",
    "syslog": "call('syslog', 10, None, 0)",
}  # fmt: skip

REFUSED = re.compile(
    r"cannot be read \((PermissionError|OSError: \[Errno 38\]|RuntimeError: can't)"
)


@pytest.fixture(scope="module", autouse=True)
def reading_process_that_obeys() -> Iterator[None]:
    with obeying_readers():
        yield


@dataclass(frozen=True)
class Place:
    """A folder as a child might find it, and what must be the same after a probe."""

    folder: Path

    @classmethod
    def made(cls, folder: Path) -> Place:
        for name, text in (
            ("victim", "kept"),
            ("shm.db", "kept"),
            ("home/.ssh/id_ed25519", "kept"),
        ):
            (folder / name).parent.mkdir(parents=True, exist_ok=True)
            (folder / name).write_text(text)
        (folder / "folder").mkdir()
        return cls(folder)

    def told(self) -> list[tuple[str, int, int, int, int]]:
        found = []
        for path in sorted([self.folder, *self.folder.rglob("*")]):
            if not path.name.startswith("trap"):
                s = path.lstat()
                times = 0 if path == self.folder else s.st_mtime_ns  # the trap was put into it
                found.append((str(path), s.st_mode, s.st_uid, s.st_size, times))
        return found


@pytest.mark.parametrize("name", ["trap.py", "trap.py.gz"])
@pytest.mark.parametrize("probe", PROBES)
def test_a_child_that_was_taken_over_changes_nothing_and_learns_nothing(
    tmp_path: Path, probe: str, name: str
) -> None:
    place, trap = Place.made(tmp_path), tmp_path / name
    before = place.told()
    with pytest.raises(BadInput) as refusal:
        obey(trap, f"{PRELUDE}\n{PROBES[probe]}\nfound = 'it succeeded'")
    assert REFUSED.match(refusal.value.message), refusal.value.message
    assert place.told() == before
    assert trap.stat().st_mode & 0o777 == 0o644


@pytest.mark.skipif(platform.machine() != "x86_64", reason="only these have two more sets")
def test_the_other_numbers_of_the_same_calls_do_not_help(tmp_path: Path) -> None:
    """Those of x32 fail; those of 32 bits, getpid by `int 0x80`, kill the child."""
    code = "numbers['x32'] = (0x40000000 + 39,); call('x32'); found = 'it succeeded'"
    with pytest.raises(BadInput, match="PermissionError"):
        obey(tmp_path / "trap.py", PRELUDE + code)
    machine_code = "b'\\xb8\\x14\\x00\\x00\\x00\\xcd\\x80\\xc3'"
    code = f"""
import mmap
page = mmap.mmap(-1, 4096, prot=mmap.PROT_READ | mmap.PROT_WRITE | mmap.PROT_EXEC)
page.write({machine_code})
address = ctypes.addressof(ctypes.c_char.from_buffer(page))
found = str(ctypes.CFUNCTYPE(ctypes.c_int)(address)())
"""
    with pytest.raises(BadInput, match=r"made the reader crash \(SIGSYS\)"):
        obey(tmp_path / "trap.py", PRELUDE + code)


def test_what_unpacks_makes_new_files_in_its_own_folder_and_changes_none(tmp_path: Path) -> None:
    code = """
from shm.read import content
folder = content._given.get()
(folder / 'made').mkdir()
with open(folder / 'made' / 'new', 'xb') as file:
    file.write(b'1')
for verb in (lambda: open(folder / 'made' / 'new', 'ab'), lambda: os.unlink(folder / 'made/new')):
    try:
        verb()
    except PermissionError:
        continue
    os._exit(3)
raise KeyError(*(str(each.relative_to(folder)) for each in folder.rglob('*')))
"""
    with pytest.raises(BadInput, match=r"KeyError.*made/new"):
        obey(tmp_path / "trap.py.gz", PRELUDE + code)


@pytest.mark.parametrize(
    ("broken", "missing"),
    [
        ("pass", {}),
        ("confinement.CALLS = {}", {"seccomp": "are not known to shm"}),
        ("confinement._SET_SECCOMP = 9999", {"seccomp": "built without filters"}),
        ("confinement._CREATE_RULESET = 9999", {"Landlock": "Linux has it from 5.13"}),
    ],
)
def test_a_bound_that_the_system_lacks_is_said_and_the_others_hold(
    tmp_path: Path, broken: str, missing: dict[str, str]
) -> None:
    with obeying_readers(broken):
        found = sandbox.missing_bounds()
        assert found.keys() == missing.keys()
        assert all(words in found[name] for name, words in missing.items())
        probe = "open('/etc/passwd')" if "Landlock" not in missing else "os.fork()"
        with pytest.raises(BadInput, match="PermissionError"):
            obey(tmp_path / "trap.py", f"{probe}; found = 'it succeeded'")


def test_a_child_may_use_so_much_of_each_and_holds_no_file_but_its_own(tmp_path: Path) -> None:
    """No core, its seconds, no file that grows, few open at a time, so much memory."""
    code = """
import resource, sys
limits = [resource.getrlimit(getattr(resource, 'RLIMIT_' + name))
          for name in ('CORE', 'NOFILE', 'FSIZE')]
seconds, most = resource.getrlimit(resource.RLIMIT_CPU)
memory, same = resource.getrlimit(resource.RLIMIT_AS)
nowhere = [os.fstat(k).st_rdev == os.stat('/dev/null').st_rdev for k in (0, 1, 2)]
open_files = 0
for k in range(3, 1500):
    try:
        os.fstat(k)
        open_files += 1
    except OSError:
        pass
raise KeyError(limits, most - seconds, memory == same > 0, nowhere, open_files)
"""
    expected = "([(0, 0), (64, 64), (0, 0)], 1, True, [True, True, True], 1)"
    with pytest.raises(BadInput, match=re.escape(f"KeyError: {expected}")):
        obey(tmp_path / "trap.py", code)


@pytest.mark.parametrize(
    "broken",
    [
        "confinement._NO_NEW_PRIVILEGES = 9999",
        "confinement._RESTRICT_SELF = 9999",
        "confinement._ADD_RULE = 9999",
        "confinement.filter_of = lambda *_: [(0, 0, 0, 0)] * 5000",
        "confinement.resource.setrlimit = lambda *_: 1 / 0",
    ],
)
def test_where_a_bound_cannot_be_put_in_force_nothing_is_read_and_no_file_is_blamed(
    tmp_path: Path, broken: str
) -> None:
    with obeying_readers(broken), pytest.raises(ShmError, match="cannot be confined") as refusal:
        obey(tmp_path / "trap.py", "open(path.parent / 'new', 'w'); found = 'it succeeded'")
    assert not isinstance(refusal.value, BadInput)
    assert refusal.value.retry_after_s
    assert not (tmp_path / "new").exists()


@pytest.mark.parametrize("unpacks", [False, True])
@pytest.mark.parametrize("machine", confinement.CALLS)
def test_a_filter_ends_in_a_refusal_and_jumps_within_itself(machine: str, unpacks: bool) -> None:
    steps = confinement.filter_of(machine, unpacks, 77)
    assert len(steps) < 4096  # BPF_MAXINSNS
    for place, (code, jump, other, _) in enumerate(steps):
        assert 0 <= jump < 256
        assert 0 <= other < 256
        if code & 7 == 5:
            assert place + 1 + max(jump, other) < len(steps)
    _, plain, by_name = confinement.CALLS[machine]
    numbers = [*plain, *by_name.values()]
    assert len(set(numbers)) == len(numbers)
    assert max(numbers) < confinement._NEWER_THAN_WE


HEADERS = {
    "x86_64": Path("/usr/include/x86_64-linux-gnu/asm/unistd_64.h"),
    "aarch64": Path("/usr/include/asm-generic/unistd.h"),
}
NEVER = (
    "socket", "connect", "bind", "clone", "fork", "vfork", "execve", "ptrace", "unlinkat", "linkat",
    "renameat", "renameat2", "symlinkat", "mknodat", "fchmodat", "fchmod", "fchownat", "utimensat",
    "truncate", "ftruncate", "setxattr", "mount", "unshare", "setns", "io_uring_setup", "bpf",
    "memfd_create", "keyctl", "sendto", "sendmsg", "pwrite64", "prctl", "flock", "setsid",
    "setitimer", "timer_create", "openat2", "process_vm_readv", "pidfd_open", "sched_setaffinity",
)  # fmt: skip


@pytest.mark.parametrize("machine", confinement.CALLS)
def test_the_numbers_are_those_of_the_kernels_headers(machine: str) -> None:
    if not HEADERS[machine].exists():
        pytest.skip("linux-libc-dev is not installed")
    text = HEADERS[machine].read_text()
    known = dict(re.findall(r"#define __NR(?:3264)?_(\w+)\s+(\d+)", text))
    _, plain, by_name = confinement.CALLS[machine]
    for name, number in by_name.items():
        assert int(known[name]) == number, name
    source = Path(confinement.__file__).read_text()
    section = source.split(f'"{machine}": (')[1].split("},")[0]
    listed: list[str] = []
    for line in re.findall(r"# (.+)", section):
        listed += [name.strip() for name in line.split(",") if name.strip()]
    assert [int(known["fstatat" if name not in known else name]) for name in listed] == [*plain]
    assert not {int(known[name]) for name in NEVER if name in known} & {*plain}


@pytest.mark.slow
def test_hundreds_of_files_are_read_one_after_the_other(
    tmp_path: Path, recording: Recording
) -> None:
    paths = [tmp_path / f"test{kind.suffixes[0]}" for kind in FORMATS if kind.names_channels]
    for path in paths:
        write(recording, path)
    for _ in range(200 // len(paths)):
        assert all(len(sandbox.read_test(path)) == 1 for path in paths)
