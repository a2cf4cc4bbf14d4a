"""Converts URDFs: table.py reads one as a robot file's tables, writer.py writes one."""
