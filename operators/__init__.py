"""One operator per file. Each gathers, calls the engine through gssmc_addon, and reports in one sentence."""
