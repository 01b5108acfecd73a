"""Reproduces every figure of README and docs, one command each."""

import companion  # noqa: F401 - limits numpy's threads, so it must be imported before numpy
