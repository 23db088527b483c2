/* The finished splats over the viewport. Its overlay buffer wants linear light and encodes it by itself; splat colours are
   display-encoded already. */

void main()
{
  vec4 splats = texture(splats_tex, place);
  if (splats.a <= 0.0) {
    discard;
  }
  vec3 shown = clamp(splats.rgb / splats.a, 0.0, 1.0);
  vec3 light = mix(shown / 12.92, pow((shown + 0.055) / 1.055, vec3(2.4)), step(0.04045, shown));
  float alpha = splats.a * opacity;
  fragColor = vec4(light * alpha, alpha);
}
