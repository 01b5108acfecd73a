"""Types shared by all packages: messages, frames, values, errors, text files."""
