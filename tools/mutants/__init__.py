"""Mutation testing: small changes of the code, one at a time, that the tests should find."""
