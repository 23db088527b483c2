/* EWA projection and colour of one Gaussian to a fragment, as core/render/project.py and reference.py have them.

Out: bounds = centre x y and half width and height in pixels of the ellipse where alpha is 1/255; form = l1, l2, l3 and log
opacity, of q = (l1 dx + l2 dy)^2 + (l3 dy)^2; light = RGB and depth. */

vec4 texel_of(int number)
{
  return texelFetch(scan_tex, ivec2(number % TABLE_WIDTH, number / TABLE_WIDTH), 0);
}

vec3 colour(int begin, vec3 d)
{
  vec3 sh[4 * SH_TEXELS / 3 + 1];
  float row[4 * SH_TEXELS];
  for (int k = 0; k < SH_TEXELS; k++) {
    vec4 four = texel_of(begin + k);
    row[4 * k] = four.x;
    row[4 * k + 1] = four.y;
    row[4 * k + 2] = four.z;
    row[4 * k + 3] = four.w;
  }
  for (int k = 0; k < SH_COUNT; k++) {
    sh[k] = vec3(row[3 * k], row[3 * k + 1], row[3 * k + 2]);
  }
  vec3 rgb = vec3(0.5) + SH_C0 * sh[0];
#if SH_COUNT > 1
  rgb += SH_C1 * (d.z * sh[2] - d.y * sh[1] - d.x * sh[3]);
#endif
#if SH_COUNT > 4
  float xx = d.x * d.x, yy = d.y * d.y, zz = d.z * d.z;
  rgb += SH_C2_0 * d.x * d.y * sh[4] + SH_C2_1 * d.y * d.z * sh[5] + SH_C2_2 * (2.0 * zz - xx - yy) * sh[6];
  rgb += SH_C2_3 * d.x * d.z * sh[7] + SH_C2_4 * (xx - yy) * sh[8];
#endif
#if SH_COUNT > 9
  rgb += SH_C3_0 * d.y * (3.0 * xx - yy) * sh[9] + SH_C3_1 * d.x * d.y * d.z * sh[10];
  rgb += SH_C3_2 * d.y * (4.0 * zz - xx - yy) * sh[11] + SH_C3_3 * d.z * (2.0 * zz - 3.0 * xx - 3.0 * yy) * sh[12];
  rgb += SH_C3_4 * d.x * (4.0 * zz - xx - yy) * sh[13] + SH_C3_5 * d.z * (xx - yy) * sh[14];
  rgb += SH_C3_6 * d.x * (xx - 3.0 * yy) * sh[15];
#endif
  return max(rgb, vec3(0.0));
}

void main()
{
  int number = int(gl_FragCoord.y) * TABLE_WIDTH + int(gl_FragCoord.x);
  bounds = vec4(0.0);
  form = vec4(0.0);
  light = vec4(0.0);
  if (number >= int(view.sizes.z)) {
    return;
  }
  vec4 point = texelFetch(points_tex, ivec2(gl_FragCoord.xy), 0);
  int begin = int(point.w) * TEXELS;
  vec4 t0 = texel_of(begin), t1 = texel_of(begin + 1), t2 = texel_of(begin + 2);
  float z = point.z;
  vec2 focal = view.lens.xy, centre = view.lens.zw;
  vec2 plane = point.xy / z;
  vec2 pixel = plane * focal + centre;
  plane = clamp(plane, view.limits.xy, view.limits.zw);

  /* Rows of the world-to-camera rotation times the scaled axes. */
  mat3 axes = mat3(vec3(t0.x, t0.w, t1.z), vec3(t0.y, t1.x, t1.w), vec3(t0.z, t1.y, t2.x));
  mat3 turned = mat3(view.turn[0].xyz, view.turn[1].xyz, view.turn[2].xyz) * axes;
  vec3 ax = vec3(turned[0].x, turned[1].x, turned[2].x);
  vec3 ay = vec3(turned[0].y, turned[1].y, turned[2].y);
  vec3 az = vec3(turned[0].z, turned[1].z, turned[2].z);
  vec3 rx = (ax - plane.x * az) * (focal.x / z);
  vec3 ry = (ay - plane.y * az) * (focal.y / z);

  /* 1 / l1^2 is the variance of x where y is known. Cauchy-Binet keeps that of a needle, where a c - b^2 would cancel. */
  float xx = dot(rx, rx), yy = dot(ry, ry) + LOWPASS;
  float covariance = dot(rx, ry);
  float l3 = inversesqrt(yy);
  vec3 minors = cross(rx, ry * l3);
  float bare = dot(minors, minors);
  float within = LOWPASS * xx * l3 * l3 + LOWPASS + bare;
  float l1 = inversesqrt(within);
  float l2 = -covariance * l3 * l3 * l1;

  float log_opacity = t2.y;
  float cut = max(2.0 * (log_opacity + LOG_255), 0.0) + CUT_MARGIN;
#ifdef ANTIALIASED
  float log_share = log(max(bare / within, 1e-30));
  log_opacity += 0.5 * log_share;
  cut = max(cut + log_share, CUT_MARGIN);
#endif
  /* The world's direction from the camera's centre is the camera's, turned back. */
  vec3 ahead = point.xyz / max(length(point.xyz), 1e-30);
  vec3 direction = vec3(dot(view.turn[0].xyz, ahead), dot(view.turn[1].xyz, ahead), dot(view.turn[2].xyz, ahead));

  float radius = sqrt(cut);
  bounds = vec4(pixel, radius * sqrt(xx + LOWPASS), radius / l3);
  form = vec4(l1, l2, l3, log_opacity);
  light = vec4(colour(begin + 3, direction), z);
}
