"""Words that every room uses: messages between the stages, frames, values, errors, text."""
