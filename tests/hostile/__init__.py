"""Files that mean harm, of every format: refused in one line, without code, hang or stray file."""
