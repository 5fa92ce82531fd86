//! End-to-end tests: of the commands in `tests/end_to_end`, of what Python reads in `python`.
