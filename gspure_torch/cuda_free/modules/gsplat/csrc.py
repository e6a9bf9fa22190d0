"""In place of the compiled part of an installed gsplat: empty, so that all else of it can be imported."""
