"""The report: tables in several formats, the owner's audit in words, and the page that holds both."""
