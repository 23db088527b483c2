"""Pictures that set a photo against the splat."""
