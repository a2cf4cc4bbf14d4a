"""The plant FMU through importers that no one here wrote."""
