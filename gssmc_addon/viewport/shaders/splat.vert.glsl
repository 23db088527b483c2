/* One Gaussian as a quad around its ellipse in the image: EWA projection as the engine's renderer does it. */

void main()
{
  int turn_no = gl_InstanceID + int(view.more.y); /* from the farthest */
  int id = int(texelFetch(order_tex, ivec2(turn_no % TABLE_WIDTH, turn_no / TABLE_WIDTH), 0).r);
  ivec2 cell = ivec2(id % TABLE_WIDTH, id / TABLE_WIDTH);
  vec4 place = texelFetch(place_tex, cell, 0); /* x y z, opacity */
  vec4 first = texelFetch(shape_tex, cell, 0); /* covariance xx xy xz yy */
  vec4 rest = texelFetch(color_tex, cell, 0);  /* covariance yz zz, colour as 256^2 r + 256 g + b */

  vec4 seen = view.view_model * vec4(place.xyz, 1.0);
  vec4 clip = view.projection * seen;
  gl_Position = vec4(2.0, 2.0, 2.0, 1.0); /* outside, unless all is well */
  color = vec4(0.0);
  offset = vec2(0.0);
  float cut = 2.0 * log(255.0 * place.w); /* (distance in standard deviations)^2 where alpha falls to 1/255 */
  bool perspective = view.projection[2][3] != 0.0;
  if (cut <= 0.0 || clip.w <= 0.0 || (perspective && -seen.z <= view.near)) {
    return;
  }

  /* Rows of d(pixel) / d(view position), taken at most 0.3 half views beyond the border. */
  vec2 ndc = clip.xy / clip.w;
  vec2 held = clamp(ndc, -1.3, 1.3);
  mat4 p = transpose(view.projection);
  vec3 jx = (p[0].xyz - held.x * p[3].xyz) * (0.5 * view.size.x / clip.w);
  vec3 jy = (p[1].xyz - held.y * p[3].xyz) * (0.5 * view.size.y / clip.w);
  mat3 turn = mat3(view.view_model);
  vec3 rx = transpose(turn) * jx;
  vec3 ry = transpose(turn) * jy;
  mat3 cov = mat3(first.x, first.y, first.z, first.y, first.w, rest.x, first.z, rest.x, rest.y) * (view.boost * view.boost);
  float a = dot(rx, cov * rx) + LOWPASS;
  float c = dot(ry, cov * ry) + LOWPASS;
  float b = dot(rx, cov * ry);

  float middle = 0.5 * (a + c);
  float spread = sqrt(0.25 * (a - c) * (a - c) + b * b);
  float large = middle + spread;
  float small = max(middle - spread, LOWPASS);
  vec2 axis = (abs(b) > 1e-6 * large) ? normalize(vec2(b, large - a)) : ((a >= c) ? vec2(1.0, 0.0) : vec2(0.0, 1.0));
  offset = corner * sqrt(cut);
  vec2 pixels = axis * (offset.x * sqrt(large)) + vec2(-axis.y, axis.x) * (offset.y * sqrt(small));
  if (abs(ndc.x) * view.size.x > view.size.x + 2.0 * sqrt(cut * a) || abs(ndc.y) * view.size.y > view.size.y + 2.0 * sqrt(cut * c)) {
    return;
  }
  vec3 rgb = floor(mod(vec3(rest.z / 65536.0, rest.z / 256.0, rest.z), 256.0)) / 255.0;
  color = vec4(rgb, place.w);
  gl_Position = vec4((ndc + 2.0 * pixels / view.size) * clip.w, clip.z, clip.w);
}
