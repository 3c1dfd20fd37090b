"""Methods of others, with their own weights, on our renders and on captured light fields. Nothing of theirs ships."""
