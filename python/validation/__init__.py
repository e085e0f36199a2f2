"""The document docs/validation.md: the paper's statements and questions beyond it, against measured results."""
