"""What a path-traced 8K light field 30 times a second asks of a GPU: counted, and measured where there is one."""
