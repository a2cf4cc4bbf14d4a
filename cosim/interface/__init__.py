"""The FMU variables: names, arrays, start values and model descriptions. Imports `common`."""
