/* One more batch behind what was drawn before it.

light: RGB, transmittance. state: sum of weights, mean depth, sum of squared deviations from it, and the number from 1 of the
batch in which the pixel ends, whose splats it does not hold yet; 0 while it has not ended. */

void main()
{
  ivec2 p = ivec2(gl_FragCoord.xy);
  light = texelFetch(light_tex, p, 0);
  state = texelFetch(state_tex, p, 0);
  vec4 more = texelFetch(batch_light_tex, p, 0);
  if (state.w > 0.0 || more.a <= 0.0) {
    return;
  }
  float after = light.a * (1.0 - more.a);
  if (after < TRANSMITTANCE_MIN) {
    state.w = float(batch + 1);
    return;
  }
  vec4 depths = texelFetch(batch_depth_tex, p, 0);
  float mean = depths.x / depths.a;
  float weight = light.a * depths.a;
  float deviation = max(depths.y - depths.x * mean, 0.0) * light.a;
  float total = state.x + weight;
  float shift = depth0 + mean - state.y;
  state.z += deviation + shift * shift * (state.x * weight / total);
  state.y += shift * (weight / total);
  state.x = total;
  light = vec4(light.rgb + light.a * more.rgb, after);
}
