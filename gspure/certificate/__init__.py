"""Whether a scheme or an attack of a plug-in keeps the rules of docs/extending.md: checks, one after the other."""
