"""The last stage: corners followed on finer renders, joined in one robust problem."""
