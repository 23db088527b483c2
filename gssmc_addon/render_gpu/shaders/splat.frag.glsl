/* Premultiplied colour and depth of one splat at one pixel. */

void main()
{
  ivec2 p = ivec2(gl_FragCoord.xy);
  if (texelFetch(state_tex, p, 0).w > 0.0) {
    discard; /* the pixel ended in an earlier batch */
  }
  vec2 d = gl_FragCoord.xy - centre.xy;
  float a = form.x * d.x + form.y * d.y, b = form.z * d.y;
  float alpha = min(ALPHA_MAX, exp(form.w - 0.5 * (a * a + b * b)));
  if (alpha < ALPHA_MIN) {
    discard;
  }
  light = vec4(rgb.rgb * alpha, alpha);
  depths = vec4(centre.z * alpha, centre.z * centre.z * alpha, 0.0, alpha);
}
