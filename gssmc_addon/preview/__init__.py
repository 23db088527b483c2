"""See the fit: the splat set against the photo."""
