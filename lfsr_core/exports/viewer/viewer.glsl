#version 300 es
// View of a light field behind lenses, for one eye. Millimetres from the centre of the display: x rightwards, y upwards,
// z towards the viewer; lenses and views are counted from the left and from the top.
precision highp float;
precision highp int;
uniform sampler2D eia;
uniform highp isampler2D seen;    // panel pixel that the eye sees through each lens: across in row 0, upwards in row 1
uniform ivec2 lenses, views;
uniform bool flipped;             // the pixels inside each elemental image are in reverse order
uniform vec2 texelsPerPixel;      // below 1 where the image was downscaled for this GPU or holds fewer views
uniform vec2 panel;               // its size
uniform float viewDistance, spacing;
uniform vec3 eye;
uniform float focus, aperture;    // depth in focus; width of the pupil
uniform int pupil;                // samples of it
uniform int mode;                 // 0 smooth, 1 physical, 2 disagreement of cameras per depth at one place
uniform vec2 corner, perPixel;    // lower left corner of the viewport; millimetres per pixel
uniform float farthest, depthStep; // depths of mode 2, as relative sizes of things there
uniform vec2 target;              // place of mode 2
out vec4 color;

// Pixel on the panel of a view of a lens; `view` is in camera order. Nothing else computes it.
vec3 panelPixel(ivec2 lens, ivec2 view) {
  ivec2 inside = flipped ? views - 1 - view : view;
  return texelFetch(eia, ivec2((vec2(lens * views + inside) + 0.5) * texelsPerPixel), 0).rgb;
}

// Physical mode: one pixel through each lens, that of a neighbour beyond the zone, black beyond the panel.
vec3 physical(vec2 place) {
  ivec2 lens = ivec2(floor((place / panel + 0.5) * vec2(lenses)));  // counted from below, like the pixels
  ivec2 pixel = ivec2(texelFetch(seen, ivec2(lens.x, 0), 0).r, texelFetch(seen, ivec2(lens.y, 1), 0).r);
  if (any(lessThan(pixel, ivec2(0))) || any(greaterThanEqual(pixel, lenses * views))) return vec3(0);
  lens = pixel / views;
  pixel -= lens * views;
  return panelPixel(ivec2(lens.x, lenses.y - 1 - lens.y), ivec2(views.x - 1 - pixel.x, pixel.y));
}

// Colour of a point in camera `view`, interpolated between the four lenses around its line.
vec3 camera(ivec2 view, vec3 point) {
  vec2 from = vec2(1, -1) * (vec2(view) + 0.5 - vec2(views) * 0.5) * spacing;
  vec2 place = from + (point.xy - from) * viewDistance / (viewDistance - point.z);
  vec2 lens = clamp((vec2(1, -1) * place / panel + 0.5) * vec2(lenses) - 0.5, vec2(0), vec2(lenses - 1));
  ivec2 low = ivec2(lens), high = min(low + 1, lenses - 1);
  vec2 f = lens - vec2(low);
  return mix(mix(panelPixel(low, view), panelPixel(ivec2(high.x, low.y), view), f.x),
             mix(panelPixel(ivec2(low.x, high.y), view), panelPixel(high, view), f.x), f.y);
}

// Light from a point to an eye, interpolated between the four cameras around its line on the camera plane.
vec3 smoothly(vec3 from, vec3 point) {
  vec2 on = from.xy + (point.xy - from.xy) * (from.z - viewDistance) / (from.z - point.z);
  vec2 view = clamp(vec2(1, -1) * on / spacing + vec2(views) * 0.5 - 0.5, vec2(0), vec2(views - 1));
  ivec2 low = ivec2(view), high = min(low + 1, views - 1);
  vec2 f = view - vec2(low);
  return mix(mix(camera(low, point), camera(ivec2(high.x, low.y), point), f.x),
             mix(camera(ivec2(low.x, high.y), point), camera(high, point), f.x), f.y);
}

vec3 throughPupil(vec2 place) {
  vec3 point = vec3(eye.xy + (place - eye.xy) * (eye.z - focus) / eye.z, focus);
  if (aperture <= 0.0) return smoothly(eye, point);
  vec3 sum = vec3(0);
  for (int i = 0; i < pupil; i++) {
    float turn = float(i) * 2.39996323, radius = sqrt((float(i) + 0.5) / float(pupil)) * aperture * 0.5;
    vec3 c = smoothly(eye + vec3(cos(turn), sin(turn), 0) * radius, point);
    sum += c * c;  // light adds, screen values do not
  }
  return sqrt(sum / float(pupil));
}

// Disagreement of 25 cameras around a place for one depth per column.
float disagreement(float larger) {
  float depth = viewDistance - viewDistance / (1.0 + larger);
  vec2 pitch = panel / vec2(lenses);
  float sum = 0.0;
  for (int patch_ = 0; patch_ < 25; patch_++) {
    vec2 place = target + pitch * 0.7 * vec2(patch_ % 5 - 2, patch_ / 5 - 2);
    vec3 point = vec3(eye.xy + (place - eye.xy) * (eye.z - depth) / eye.z, depth), first = vec3(0), second = vec3(0);
    for (int i = 0; i < 25; i++) {
      vec3 c = camera(ivec2(vec2(views - 1) * (0.15 + 0.175 * vec2(i % 5, i / 5)) + 0.5), point);
      first += c / 25.0;
      second += c * c / 25.0;
    }
    sum += dot(max(second - first * first, 0.0), vec3(1)) / 25.0;
  }
  return sqrt(sum / 3.0);
}

void main() {
  if (mode == 2) {
    float value = clamp(disagreement(farthest + depthStep * floor(gl_FragCoord.x)), 0.0, 0.999) * 255.0;
    color = vec4(floor(value) / 255.0, fract(value), 0, 1);
    return;
  }
  vec2 place = corner + gl_FragCoord.xy * perPixel;
  vec2 beyond = abs(place) - panel * 0.5;
  if (max(beyond.x, beyond.y) > 0.0) {
    // The display's edge, on a dark wall.
    color = vec4(vec3(max(beyond.x, beyond.y) < panel.x * 0.012 ? 0.13 : 0.055), 1);
    return;
  }
  color = vec4(mode == 1 ? physical(place) : throughPupil(place), 1);
}
