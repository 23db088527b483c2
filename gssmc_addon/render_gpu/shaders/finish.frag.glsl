/* The image: what was joined, and for a pixel that ends, the splats of its last batch one after the other.

A pixel ends before the splat that would take its transmittance below the limit, and blending cannot stop there. */

void main()
{
  ivec2 p = ivec2(gl_FragCoord.xy);
  vec4 light = texelFetch(light_tex, p, 0);
  vec4 state = texelFetch(state_tex, p, 0);
  vec3 rgb = light.rgb;
  if (state.w > 0.0) {
    int begin = (int(state.w) - 1) * batch_size;
    int end = min(begin + batch_size, count);
    float depth0 = texelFetch(splat_light_tex, ivec2(begin % TABLE_WIDTH, begin / TABLE_WIDTH), 0).w;
    float left = light.a;
    vec3 sums = vec3(0.0); /* of weights, and of weights times relative depths and their squares */
    for (int number = begin; number < end; number++) {
      ivec2 cell = ivec2(number % TABLE_WIDTH, number / TABLE_WIDTH);
      vec4 bounds = texelFetch(bounds_tex, cell, 0);
      vec2 d = gl_FragCoord.xy - bounds.xy;
      if (abs(d.x) > bounds.z + 0.01 || abs(d.y) > bounds.w + 0.01) {
        continue; /* most of a batch lies elsewhere */
      }
      vec4 f = texelFetch(form_tex, cell, 0);
      float a = f.x * d.x + f.y * d.y, b = f.z * d.y;
      float alpha = min(ALPHA_MAX, exp(f.w - 0.5 * (a * a + b * b)));
      if (alpha < ALPHA_MIN) {
        continue;
      }
      float after = left * (1.0 - alpha);
      if (after < TRANSMITTANCE_MIN) {
        break;
      }
      vec4 own = texelFetch(splat_light_tex, cell, 0);
      float weight = left * alpha, z = own.w - depth0;
      rgb += weight * own.rgb;
      sums += weight * vec3(1.0, z, z * z);
      left = after;
    }
    if (sums.x > 0.0) {
      float mean = sums.y / sums.x;
      float total = state.x + sums.x;
      float shift = depth0 + mean - state.y;
      state.z += max(sums.z - sums.y * mean, 0.0) + shift * shift * (state.x * sums.x / total);
      state.y += shift * (sums.x / total);
      state.x = total;
    }
  }
  picture = vec4(rgb, state.x);
  depths = vec4(state.y, state.x > 0.0 ? state.z / state.x : 0.0, 0.0, 0.0);
}
