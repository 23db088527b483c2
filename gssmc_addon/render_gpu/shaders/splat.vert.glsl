/* A quad around one splat's ellipse: instance 0 is the last of the batch, the farthest. */

void main()
{
  int number = last - gl_InstanceID;
  ivec2 cell = ivec2(number % TABLE_WIDTH, number / TABLE_WIDTH);
  vec4 m = texelFetch(middle_tex, cell, 0);
  vec4 s = texelFetch(spread_tex, cell, 0);
  centre = m;
  form = vec4(s.x, s.y, s.z - depth0, 0.0);
  rgb = texelFetch(light_tex, cell, 0);

  /* The margin is more than a rasteriser's rounding of corners. */
  float radius = s.w + 0.02;
  vec2 extent = radius * vec2(sqrt(1.0 + (m.w / s.x) * (m.w / s.x)) / m.z, 1.0 / s.x);
  vec2 size = vec2(float(width), float(height));
  vec2 place;
  if (max(extent.x, extent.y) > size.x + size.y) {
    /* Much larger than the image: what of its bounds lies there, lest the corners lose their places to rounding. */
    vec2 low = clamp(m.xy - extent, vec2(-1.0), size + 1.0), high = clamp(m.xy + extent, vec2(-1.0), size + 1.0);
    place = mix(low, high, 0.5 * corner + 0.5);
  }
  else {
    /* The square around the unit circle, sheared and stretched to the ellipse. */
    vec2 unit = corner * radius;
    float dy = unit.y / s.x;
    place = m.xy + vec2((unit.x - m.w * dy) / m.z, dy);
  }
  gl_Position = vec4(2.0 * place / size - 1.0, 0.0, 1.0);
}
