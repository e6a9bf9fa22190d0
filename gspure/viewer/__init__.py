"""The 3-D view of models in a browser: its data, and its page, the parts of which the report embeds."""
