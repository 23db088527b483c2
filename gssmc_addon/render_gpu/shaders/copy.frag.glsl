/* A part of a table into its rows of the whole. */

void main()
{
  ivec2 cell = ivec2(gl_FragCoord.xy);
  texel = texelFetch(part_tex, ivec2(cell.x, cell.y - first_row), 0);
}
