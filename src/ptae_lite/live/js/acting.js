// An episode in the page's physics, and its verdict: closed_loop.py for a page.
"use strict";
var PtaeLive = globalThis.PtaeLive ||= {};

// setting: places_m and yaws_rad of the cubes; perhaps shift: {frame, away_m, by_m}, a hand that moves
// the cubes: not before that frame, and not before the fingertips are so far from where they are at
// home. `event` is the frame in which it does. That is no part of how far a cube went: `start` goes along.
// An episode: act({joints_rad, cubes, frame}) gives the next target of the joints, or a promise of it.
// It ends when the arm has left home, has come back and has rested there, or after `limit` frames.
PtaeLive.perform = async (world, setting, act) => {
  const {rule, home_rad, lower_rad, upper_rad} = world.scene, slack = 1e-9;
  const episode = {joints_rad: [], cubes: [], touched: [[false, false]], stopped: "limit", event: -1};
  const {frame: soonest = 0, away_m = 0, by_m} = setting.shift ?? {}, {inverse} = world;
  let rest = 0, left = false;
  world.reset(setting);
  episode.start = world.cubes();
  for (let frame = 0; frame < rule.limit; frame++) {
    if (by_m && episode.event < 0 && frame >= soonest && inverse.away_m(world.joints_rad()) >= away_m) {
      episode.event = frame;
      by_m.forEach((far, side) => {
        if (far[0] || far[1]) world.shift(side, far);
        far.forEach((way, xy) => { episode.start[side][xy] += way; });
      });
    }
    const joints_rad = world.joints_rad(), cubes = world.cubes();
    episode.joints_rad.push(joints_rad);
    episode.cubes.push(cubes);
    const off = Math.max(...joints_rad.map((angle, j) => Math.abs(angle - home_rad[j])));
    left ||= off > rule.away_rad;
    rest = left && off < rule.home_rad ? rest + 1 : 0;
    if (rest === rule.at_rest) {
      episode.stopped = "home";
      break;
    }
    if (frame === rule.limit - 1) break;
    const wish = Array.from(await act({joints_rad, cubes, frame}));
    if (!wish.every((angle, j) => angle >= lower_rad[j] - slack && angle <= upper_rad[j] + slack)) {
      episode.stopped = "joint";
      break;
    }
    episode.touched.push(world.drive(wish));
  }
  return episode;
};

// A policy that follows recorded joints and then holds the last of them.
PtaeLive.replay = joints_rad => ({frame}) => joints_rad[Math.min(frame + 1, joints_rad.length - 1)];

// Whether the arm did what the sentence said, and what went wrong first.
PtaeLive.judge = (scene, episode, {action, side, speed}) => {
  const {rule, table_top_m} = scene, named = scene.sides.indexOf(side);
  const first = episode.start, last = episode.cubes.at(-1), frames = episode.cubes.length;
  const moved_mm = last.map((cube, k) => [0, 1].map(xy => 1000 * (cube[xy] - first[k][xy])));
  const [x, y] = rule.direction[action];
  const named_mm = moved_mm[named][0] * x + moved_mm[named][1] * y;
  const other_mm = Math.hypot(...moved_mm[1 - named]);
  const wrong = {
    joint: episode.stopped === "joint",
    other: other_mm >= rule.other_mm,
    travel: named_mm < rule.travel_mm,
    home: episode.stopped === "limit",
    speed: (frames >= rule.slow_from) !== (speed === "slowly"),
    fell: last[named][2] < table_top_m,
  };
  const why = Object.keys(rule.wrong).find(name => wrong[name]);
  return {success: !why, reason: why ? rule.wrong[why] : rule.done, named_mm, other_mm, frames};
};
