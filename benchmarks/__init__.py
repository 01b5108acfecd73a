"""Every figure that README and docs claim, one command each."""

import companion  # noqa: F401 - before numpy: it sets how many threads that takes
