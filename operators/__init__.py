"""One operator per file. Each copies its inputs, calls the engine through gssmc_addon, and reports in one sentence."""
