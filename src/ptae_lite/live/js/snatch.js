// A hand that snatches the named cube away while the arm is on its way: disturbances.py for a page.
"use strict";
{
  const far = ([a, b], [c, d]) => Math.hypot(a - c, b - d);
  const along = ([x, y], way, [dx, dy]) => [x + way * dx, y + way * dy];

  // Whether cubes in these places are on the table and in nobody's way, and the arm can do the motion.
  function isFree({about, world}, places_m, named, way) {
    const {stroke, snatch, table_top_m} = about, [cube, other] = [places_m[named], places_m[1 - named]];
    if (places_m.some(([x]) => Math.abs(x - snatch.middle_x_m) > snatch.of_middle_m)) return false;
    if (far(cube, other) < snatch.apart_m) return false;
    const whole = stroke.standoff_m + stroke.travel_m;
    for (let k = 0; k < 6; k++) { // the hand goes, or the cube
      const at = k / 5 * whole - stroke.standoff_m, widest = at >= 0 ? snatch.cube_radius_m : snatch.hand_radius_m;
      if (far(along(cube, at, way), other) < snatch.cube_radius_m + widest + snatch.clear_m) return false;
    }
    const start = along(cube, -stroke.standoff_m, way), end = along(start, stroke.gap_m + stroke.travel_m, way);
    const [low, high] = [stroke.low_m, stroke.high_m].map(height => table_top_m + height);
    return world.inverse.search([[...start, high], [...start, low], [...end, low], [...end, high]])
      .every(({miss_m}) => miss_m <= world.inverse.tolerance_m);
  }

  // A shift of the named cube by chance, for `perform`; null where there is no room for one.
  PtaeLive.snatch = (robot, {places_m}, action, named, random = Math.random) => {
    const {stroke, snatch, rule, table_top_m} = robot.about, way = rule.direction[action];
    const start = along(places_m[named], -stroke.standoff_m, way);
    const above = [...start, table_top_m + stroke.high_m], {home_m} = robot.world.inverse;
    const away_m = snatch.at * Math.hypot(...above.map((x, i) => x - home_m[i]));
    for (let k = 0; k < snatch.tries; k++) {
      const angle = 2 * Math.PI * random(), by = snatch.smallest_m + (snatch.largest_m - snatch.smallest_m) * random();
      const move = [by * Math.cos(angle), by * Math.sin(angle)];
      const moved = places_m.map((place, side) => side === named ? along(place, 1, move) : place);
      if (isFree(robot, moved, named, way))
        return {away_m, by_m: places_m.map((_, side) => side === named ? move : [0, 0])};
    }
    return null;
  };
}
