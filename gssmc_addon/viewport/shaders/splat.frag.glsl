/* Premultiplied colour of one Gaussian, where nothing of the scene stands before it. */

void main()
{
  float q = dot(offset, offset);
  float alpha = min(0.99, color.a * exp(-0.5 * q));
  if (alpha < 1.0 / 255.0) {
    discard;
  }
  float step_px = view.more.x; /* pixels of the viewport to one here; 0: its depth is not known */
  if (step_px > 0.0 && gl_FragCoord.z > texelFetch(depth_tex, ivec2(gl_FragCoord.xy * step_px), 0).r) {
    discard;
  }
  fragColor = vec4(color.rgb * alpha, alpha);
}
