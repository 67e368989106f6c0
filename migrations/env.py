"""Runs the migrations on the connection that `shm.store.schema` hands over."""

from alembic import context

from shm.store.tables import metadata

connection = context.config.attributes["connection"]
context.configure(
    connection=connection,
    target_metadata=metadata,
    render_as_batch=True,
    # SQLite can roll schema changes back; without this an interrupted upgrade would stay half done.
    transactional_ddl=True,
)
with context.begin_transaction():
    context.run_migrations()
