"""`dior init`: a new project folder, filled in as far as the recordings tell."""
