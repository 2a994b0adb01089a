"""Run by Alembic: applies the versions over the connection that `database.migrate` opened."""

from alembic import context

context.configure(connection=context.config.attributes["connection"])
context.run_migrations()
