"""The shell without an event loop: `client` and `run` say what there is, `transport` carries it out."""
