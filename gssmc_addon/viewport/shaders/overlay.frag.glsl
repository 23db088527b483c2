/* The finished splats over the viewport. Its overlay buffer wants linear light and encodes it by itself; splat colours are
   display-encoded already. Pictures before the scene lie on the splats as they lie on what the viewport shows elsewhere: with
   opacity a on a splat of opacity c, both over F, the result is (1 - c) F + c ((1 - a) splat + a picture). */

vec3 decoded(vec3 shown)
{
  return mix(shown / 12.92, pow((max(shown, 0.0) + 0.055) / 1.055, vec3(2.4)), step(0.04045, shown));
}

#define LAY(k, pixels) \
  if (k < int(over.more.y)) { \
    vec2 at = vec2(dot(over.across[k].xyz, vec3(place, 1.0)), dot(over.up[k].xyz, vec3(place, 1.0))); \
    bool inside = at.x >= 0.0 && at.x <= 1.0 && at.y >= 0.0 && at.y <= 1.0; \
    bool drawn = over.across[k].w > 0.5; /* read from the viewport: premultiplied light, then encoded */ \
    vec4 found = texture(pixels, drawn ? place : at); \
    vec3 shown = drawn ? decoded(found.rgb) / max(found.a, 1e-4) : found.rgb; \
    light = mix(light, shown, inside ? over.up[k].w * (drawn ? 1.0 : found.a) : 0.0); \
  }

void main()
{
  vec4 splats = texture(splats_tex, place);
  if (splats.a <= 0.0) {
    discard;
  }
  vec3 light = decoded(clamp(splats.rgb / splats.a, 0.0, 1.0));
  LAY(0, picture_0_tex)
  LAY(1, picture_1_tex)
  LAY(2, picture_2_tex)
  LAY(3, picture_3_tex)
  float alpha = splats.a * over.more.x;
  fragColor = vec4(light * alpha, alpha);
}
