/* A quad around one splat's ellipse: instance 0 is the last of the batch, the farthest. */

void main()
{
  int number = last - gl_InstanceID;
  ivec2 cell = ivec2(number % TABLE_WIDTH, number / TABLE_WIDTH);
  vec4 bounds = texelFetch(bounds_tex, cell, 0);
  vec4 f = texelFetch(form_tex, cell, 0);
  vec4 l = texelFetch(light_tex, cell, 0);
  centre = vec4(bounds.xy, l.w - depth0, 0.0);
  form = f;
  rgb = l;

  /* The margins are more than a rasteriser's rounding of corners. */
  float radius = bounds.w * f.z + 0.02;
  vec2 extent = bounds.zw + 1.0;
  vec2 size = vec2(float(width), float(height));
  vec2 place;
  if (max(extent.x, extent.y) > size.x + size.y) {
    /* Much larger than the image: what of its bounds lies there, lest the corners lose their places to rounding. */
    vec2 low = clamp(bounds.xy - extent, vec2(-1.0), size + 1.0), high = clamp(bounds.xy + extent, vec2(-1.0), size + 1.0);
    place = mix(low, high, 0.5 * corner + 0.5);
  }
  else {
    /* The square around the unit circle, sheared and stretched to the ellipse. */
    vec2 unit = corner * radius;
    float dy = unit.y / f.z;
    place = bounds.xy + vec2((unit.x - f.y * dy) / f.x, dy);
  }
  gl_Position = vec4(2.0 * place / size - 1.0, 0.0, 1.0);
}
