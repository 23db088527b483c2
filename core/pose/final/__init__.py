"""The last stage: corners of the photo are followed in finer renders, and all of them are fitted in one robust problem."""
