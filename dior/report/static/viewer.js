// The page "3D with time" of a sequence: `window.scene` is what dior/report/viewer.py wrote, `THREE` is three.min.js.
"use strict";

(() => {
  const scene = window.scene;
  const main = document.querySelector("main");
  const NONE = -32768;
  // m: of what is drawn of a body
  const JOINT = 0.026, BONE = 0.016, RAY_BEYOND = 0.4;
  // a camera further from the walk, m, is not in the view of the whole scene; as in scene.py
  const NEAR = 20;
  const HOME_FOV = 40;
  // m above and below a person who is seen from far away
  const AROUND = 2.5;
  // ms without another frame after which the link is that of this one: browsers take a hundred in half a minute
  const LINK_AFTER = 200;
  // how long a flight to a camera takes, ms
  const FLIGHT = 700;
  const one = (selector) => document.querySelector(selector);
  const still = matchMedia("(prefers-reduced-motion: reduce)");
  const colours = {};

  async function numbersOf(text, parts) {
    const packed = Uint8Array.from(atob(text), (letter) => letter.charCodeAt(0));
    const stream = new Blob([packed]).stream().pipeThrough(new DecompressionStream("deflate"));
    const planes = new Uint8Array(await new Response(stream).arrayBuffer());
    const types = {
      int8: Int8Array, uint8: Uint8Array, int16: Int16Array, int32: Int32Array, float32: Float32Array,
    };
    const found = {};
    let at = 0;
    for (const part of parts) {
      const Type = types[part.type], size = Type.BYTES_PER_ELEMENT;
      const count = part.shape.reduce((product, side) => product * side, 1);
      const bytes = new Uint8Array(count * size);
      for (let plane = 0; plane < size; plane++) {
        for (let i = 0; i < count; i++) bytes[i * size + plane] = planes[at + plane * count + i];
      }
      const values = new Type(bytes.buffer);
      if (part.type !== "float32") {
        const row = count / part.shape[0];
        for (let i = row; i < count; i++) values[i] += values[i - row];
      }
      found[part.name] = values;
      at += count * size;
    }
    return found;
  }

  /** Index of the value of `sorted` that is nearest to `value`. */
  function nearest(sorted, value) {
    let low = 0, high = sorted.length - 1;
    while (low < high) {
      const middle = (low + high) >> 1;
      if (sorted[middle] < value) low = middle + 1;
      else high = middle;
    }
    return low > 0 && value - sorted[low - 1] <= sorted[low] - value ? low - 1 : low;
  }

  class Walk {
    constructor(numbers) {
      this.numbers = numbers;
      this.instants = numbers.instants;
      this.time = numbers.time;
      this.count = this.instants.length;
      this.joints = scene.joints.length;
      const apart = this.count > 1 ? (this.time[this.count - 1] - this.time[0]) / (this.count - 1) : 0;
      this.cameras = scene.cameras.map((camera) => {
        const own = (name) => numbers[`${camera.name} ${name}`];
        const times = own("time"), pictures = own("pictures");
        const gaps = Array.from(times.subarray(1), (t, i) => t - times[i]).sort((a, b) => a - b);
        const period = gaps.length ? gaps[gaps.length >> 1] : 0;
        return {
          ...camera, times, frames: own("frames"), pictures, views: own("views"), labels: own("labels"),
          slopes: own("rays"), pictureTimes: Int32Array.from(pictures, (row) => times[row]),
          period,
          // a picture that is no further away counts as taken at this instant: a frame before or after is further
          near: (period + apart) / 2 - 1,
        };
      });
    }

    seconds(index) {
      return this.time[index] / scene.time_steps;
    }

    /** Place of a joint, m, or null. */
    point(index, joint) {
      const at = (index * this.joints + joint) * 3, steps = this.numbers.joints;
      if (steps[at] === NONE) return null;
      return [0, 1, 2].map((axis) => scene.origin[axis] + steps[at + axis] * scene.step);
    }

    /** The first instant at which a joint is known, else the very first. */
    get first() {
      for (let index = 0; index < this.count; index++) if (this.middle(index)) return index;
      return 0;
    }

    middle(index) {
      const sum = [0, 0, 0];
      let known = 0;
      for (let joint = 0; joint < this.joints; joint++) {
        const point = this.point(index, joint);
        if (point) {
          known++;
          for (let axis = 0; axis < 3; axis++) sum[axis] += point[axis];
        }
      }
      return known ? sum.map((value) => value / known) : null;
    }

    /** The Cholesky factor of a joint's covariance, by rows, m: it makes the ellipsoid of a sphere. Or null. */
    factor(index, joint) {
      const at = (index * this.joints + joint) * 3, { sigmas, rhos } = this.numbers;
      if (!sigmas[at] || !sigmas[at + 1] || !sigmas[at + 2]) return null;
      const [x, y, z] = [0, 1, 2].map((axis) => scene.least * scene.ratio ** (sigmas[at + axis] - 1));
      const [xy, xz, yz] = [0, 1, 2].map((pair) => rhos[at + pair] / scene.parts_of_rho);
      const b = Math.sqrt(Math.max(1 - xy * xy, 1e-4)), c = (yz - xy * xz) / b;
      return [x, 0, 0, y * xy, y * b, 0, z * xz, z * c, z * Math.sqrt(Math.max(1 - xz * xz - c * c, 1e-4))];
    }

    /** Index of the picture of a camera that is shown at a time (steps), and by how much it is off, s. */
    picture(camera, time) {
      const index = nearest(camera.pictureTimes, time);
      return { index, off: (camera.pictureTimes[index] - time) / scene.time_steps };
    }

    indexOfInstant(number) {
      return nearest(this.instants, number);
    }

    /** Index of the instant nearest to a camera's own frame; -1 where the camera has no such frame. */
    indexOfFrame(name, number) {
      const camera = this.cameras.find((candidate) => candidate.name === name);
      const row = camera ? camera.frames.indexOf(number) : -1;
      return row < 0 ? -1 : nearest(this.time, camera.times[row]);
    }
  }

  class Pictures {
    constructor(walk) {
      this.walk = walk;
      this.images = new Map();
      this.shown = new Map();
      this.folder = main.dataset.pictures;
      this.figures = new Map(
        Array.from(document.querySelectorAll("figure[data-camera]"), (figure) => [figure.dataset.camera, figure]),
      );
      for (const camera of walk.cameras) {
        const canvas = this.figures.get(camera.name).querySelector("canvas");
        canvas.width = 2 * camera.tile[0];
        canvas.height = 2 * camera.tile[1];
      }
    }

    image(file) {
      if (!this.images.has(file)) {
        const image = new Image();
        image.addEventListener("load", () => this.redraw());
        image.src = this.folder + file;
        this.images.set(file, image);
      }
      return this.images.get(file);
    }

    redraw() {
      this.shown.clear();
      this.show(this.at);
    }

    show(index) {
      this.at = index;
      const time = this.walk.time[index];
      for (const camera of this.walk.cameras) {
        const { index: picture, off } = this.walk.picture(camera, time);
        const figure = this.figures.get(camera.name);
        const row = nearest(camera.times, time);
        const beside = Math.abs(camera.times[row] - time) <= camera.period;
        const apart = Math.abs(off) * scene.time_steps <= camera.near ? "" : `, ${Math.abs(off).toFixed(2)} s ${off < 0 ? "before" : "after"}`;
        figure.querySelector(".now").textContent = beside ? `frame ${camera.frames[row]}` : "not recorded";
        figure.querySelector(".off").textContent = `shown: frame ${camera.frames[camera.pictures[picture]]}, ${(camera.pictureTimes[picture] / scene.time_steps).toFixed(3)} s${apart}`;
        figure.classList.toggle("apart", apart !== "");
        if (this.shown.get(camera.name) !== picture) this.draw(camera, picture, figure);
      }
    }

    draw(camera, picture, figure) {
      this.shown.set(camera.name, picture);
      const canvas = figure.querySelector("canvas"), pen = canvas.getContext("2d");
      const [u, v, scale] = camera.views.subarray(3 * picture, 3 * picture + 3);
      const [width, height] = camera.tile, each = scene.columns ** 2, cell = picture % each;
      const whole = `${camera.name}.frame_${camera.frames[camera.pictures[picture]]}.webp`;
      const link = figure.querySelector("a");
      link.hidden = !scene.whole.includes(whole);
      pen.clearRect(0, 0, canvas.width, canvas.height);
      if (!link.hidden) {
        link.href = this.folder + whole;
        const image = this.image(whole);
        if (image.complete) {
          pen.drawImage(image, u, v, width / scale, height / scale, 0, 0, canvas.width, canvas.height);
        }
      } else {
        const file = (sheet) => `${camera.name}.${sheet}.webp`, sheet = Math.floor(picture / each);
        const image = this.image(file(sheet));
        if (image.complete && image.naturalWidth) {
          const left = (cell % scene.columns) * width, top = Math.floor(cell / scene.columns) * height;
          pen.drawImage(image, left, top, width, height, 0, 0, canvas.width, canvas.height);
          if ((sheet + 1) * each < camera.pictures.length) this.image(file(sheet + 1));
        }
      }
      this.skeleton(pen, camera, picture, (at) => [
        2 * ((camera.labels[at] / scene.pixel_steps - u + 0.5) * scale),
        2 * ((camera.labels[at + 1] / scene.pixel_steps - v + 0.5) * scale),
      ]);
    }

    skeleton(pen, camera, picture, place) {
      const first = picture * this.walk.joints * 2;
      const known = (joint) => camera.labels[first + 2 * joint] !== NONE;
      pen.lineWidth = 2;
      pen.lineCap = "round";
      for (const [a, b] of scene.bones) {
        if (!known(a) || !known(b)) continue;
        pen.strokeStyle = scene.colours[scene.sides[a] === scene.sides[b] ? scene.sides[a] : "m"];
        pen.beginPath();
        pen.moveTo(...place(first + 2 * a));
        pen.lineTo(...place(first + 2 * b));
        pen.stroke();
      }
      for (let joint = 0; joint < this.walk.joints; joint++) {
        if (!known(joint)) continue;
        pen.fillStyle = scene.colours[scene.sides[joint]];
        pen.strokeStyle = "#141414";
        pen.lineWidth = 1;
        pen.beginPath();
        pen.arc(...place(first + 2 * joint), 2.6, 0, 2 * Math.PI);
        pen.fill();
        pen.stroke();
      }
    }
  }

  class Space {
    constructor(walk, canvas) {
      this.walk = walk;
      this.canvas = canvas;
      this.renderer = new THREE.WebGLRenderer({ canvas, antialias: true });
      this.renderer.setPixelRatio(Math.min(devicePixelRatio, 2));
      this.eye = new THREE.PerspectiveCamera(HOME_FOV, 1, 0.05, 2000);
      this.eye.up.set(0, 0, 1);
      this.world = new THREE.Scene();
      this.world.add(new THREE.AmbientLight(0xffffff, 1.9));
      const sun = new THREE.DirectionalLight(0xffffff, 1.6);
      sun.position.set(1, -2, 4);
      this.world.add(sun);
      this.controls = new THREE.OrbitControls(this.eye, canvas);
      this.controls.addEventListener("change", () => this.draw());
      canvas.addEventListener("webglcontextrestored", () => this.draw());
      this.groups = { floor: this.floor(), cameras: this.cameras(), path: this.path() };
      this.body();
      this.rays();
      for (const group of Object.values(this.groups)) this.world.add(group);
      this.paint();
      new ResizeObserver(() => this.resize()).observe(canvas.parentElement);
      this.home(false);
    }

    lines(points, colour) {
      const geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(Float32Array.from(points.flat()), 3));
      return new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ color: colour }));
    }

    /** The box around the walk: [low, high], m. */
    box() {
      const low = [Infinity, Infinity, Infinity], high = [-Infinity, -Infinity, -Infinity];
      for (let index = 0; index < this.walk.count; index += Math.max(1, this.walk.count >> 9)) {
        const middle = this.walk.middle(index);
        for (let axis = 0; middle && axis < 3; axis++) {
          low[axis] = Math.min(low[axis], middle[axis]);
          high[axis] = Math.max(high[axis], middle[axis]);
        }
      }
      return Number.isFinite(low[0]) ? [low, high] : [[0, 0, 1], [0, 0, 1]];
    }

    /** Squares of a metre, or larger ones where the walk is so long, or its unit so wrong, that they would be too many. */
    floor() {
      const [low, high] = this.box(), span = Math.max(high[0] - low[0], high[1] - low[1], 1);
      const side = 10 ** Math.max(0, Math.ceil(Math.log10(span / 60)));
      one("#square").textContent = `${side} m`;
      const from = [0, 1].map((axis) => Math.floor(low[axis] / side - 1.5)), to = [0, 1].map((axis) => Math.ceil(high[axis] / side + 1.5));
      const points = [];
      for (let x = from[0]; x <= to[0]; x++) points.push([x, from[1], 0], [x, to[1], 0]);
      for (let y = from[1]; y <= to[1]; y++) points.push([from[0], y, 0], [to[0], y, 0]);
      this.grid = this.lines(points.map((point) => point.map((value) => value * side)), "#888888");
      // the world's axes, a metre each: x, y, z
      const axes = [[[1, 0, 0], "#d1495b"], [[0, 1, 0], "#3a9d5d"], [[0, 0, 1], "#3d7dd8"]];
      this.grid.add(...axes.map(([end, colour]) => this.lines([[0, 0, 0.004], [end[0], end[1], end[2] + 0.004]], colour)));
      return this.grid;
    }

    /** How the middle of the body goes, on the floor. */
    path() {
      const points = [];
      let last = null;
      for (let index = 0; index < this.walk.count; index += Math.max(1, Math.floor(this.walk.count / 600))) {
        const middle = this.walk.middle(index);
        const next = middle && [middle[0], middle[1], 0.01];
        if (last && next) points.push(last, next);
        last = next;
      }
      return this.lines(points.length ? points : [[0, 0, 0], [0, 0, 0]], "#8a6fb0");
    }

    cameras() {
      const group = new THREE.LineSegments(new THREE.BufferGeometry());
      const [low, high] = this.box(), middle = low.map((value, axis) => (value + high[axis]) / 2);
      this.blobs = [];
      this.names = [];
      for (const camera of this.walk.cameras) {
        const away = Math.hypot(...camera.centre.map((value, axis) => value - middle[axis]));
        const depth = Math.min(Math.max(0.07 * away, 0.35), 4);
        const tips = camera.corners.map((corner) => this.seen(camera, corner, depth));
        const foot = [camera.centre[0], camera.centre[1], 0];
        const up = this.seen(camera, [(camera.corners[0][0] + camera.corners[1][0]) / 2, 1.3 * camera.corners[0][1]], depth);
        group.add(
          this.lines(tips.flatMap((tip, i) => [camera.centre, tip, tip, tips[(i + 1) % 4]]), camera.colour),
          this.lines([tips[0], up, up, tips[1]], camera.colour),
          this.lines([camera.centre, foot], "#8a8f98"),
        );
        if (camera.sigma) {
          const blob = new THREE.Mesh(new THREE.SphereGeometry(1, 24, 16), this.glass(camera.colour));
          blob.matrixAutoUpdate = false;
          this.blobs.push([blob, camera]);
          group.add(blob);
        }
        const name = document.createElement("span");
        name.textContent = away > NEAR ? `${camera.name}, ${away.toFixed(0)} m away` : camera.name;
        name.addEventListener("click", () => this.fly(camera));
        one("#names").append(name);
        this.names.push([name, camera]);
      }
      return group;
    }

    glass(colour) {
      return new THREE.MeshBasicMaterial({ color: colour, transparent: true, opacity: 0.3, depthWrite: false });
    }

    /** A point, m, that a camera sees at a slope (without the lens), `depth` m ahead. */
    seen(camera, [x, y], depth) {
      return camera.centre.map((value, axis) => {
        const [right, down, ahead] = camera.wRc[axis];
        return value + depth * (right * x + down * y + ahead);
      });
    }

    body() {
      const many = (geometry, material, count) => {
        const mesh = new THREE.InstancedMesh(geometry, material, count);
        // what is drawn is elsewhere at each instant
        mesh.frustumCulled = false;
        this.world.add(mesh);
        return mesh;
      };
      const solid = () => new THREE.MeshLambertMaterial();
      this.balls = many(new THREE.SphereGeometry(JOINT, 12, 8), solid(), this.walk.joints);
      this.sticks = many(new THREE.CylinderGeometry(BONE, BONE, 1, 8), solid(), Math.max(scene.bones.length, 1));
      this.clouds = many(new THREE.SphereGeometry(1, 16, 10), this.glass("#ffffff"), this.walk.joints);
    }

    rays() {
      const room = 2 * 3 * this.walk.cameras.length * this.walk.joints, geometry = new THREE.BufferGeometry();
      geometry.setAttribute("position", new THREE.BufferAttribute(new Float32Array(room), 3));
      geometry.setAttribute("color", new THREE.BufferAttribute(new Float32Array(room), 3));
      this.beams = new THREE.LineSegments(geometry, new THREE.LineBasicMaterial({ vertexColors: true }));
      this.beams.frustumCulled = false;
      this.world.add(this.beams);
    }

    /** The colours of the page, light or dark. */
    paint() {
      const style = getComputedStyle(main), of = (name) => style.getPropertyValue(name).trim();
      this.renderer.setClearColor(of("--back"));
      this.grid.material.color.set(of("--grid"));
      Object.assign(colours, { l: of("--left"), r: of("--right"), m: of("--middle") });
      if (this.at !== undefined) this.show(this.at, this.options);
      this.draw();
    }

    show(index, options) {
      if (options.follow && this.at !== undefined) this.follow(index);
      this.at = index;
      this.options = options;
      const places = Array.from({ length: this.walk.joints }, (_, joint) => this.walk.point(index, joint));
      const colour = (side) => new THREE.Color(colours[side]);
      const put = (mesh, items) => {
        items.forEach(([matrix, side], i) => {
          mesh.setMatrixAt(i, matrix);
          mesh.setColorAt(i, colour(side));
        });
        mesh.count = items.length;
        mesh.instanceMatrix.needsUpdate = true;
        if (mesh.instanceColor) mesh.instanceColor.needsUpdate = true;
      };
      const known = places.flatMap((place, joint) => (place ? [joint] : []));
      put(this.balls, known.map((joint) => [new THREE.Matrix4().makeTranslation(...places[joint]), scene.sides[joint]]));
      put(this.sticks, scene.bones.flatMap(([a, b]) => {
        if (!places[a] || !places[b]) return [];
        return [[this.between(places[a], places[b]), scene.sides[a] === scene.sides[b] ? scene.sides[a] : "m"]];
      }));
      put(this.clouds, !options.sigmas ? [] : known.flatMap((joint) => {
        const factor = this.walk.factor(index, joint);
        return factor ? [[this.ellipsoid(places[joint], factor, options.enlarged), scene.sides[joint]]] : [];
      }));
      for (const [blob, camera] of this.blobs) {
        blob.visible = options.sigmas;
        blob.matrix.copy(this.ellipsoid(camera.centre, camera.sigma.flat(), options.enlarged));
        blob.matrixWorldNeedsUpdate = true;
      }
      this.groups.floor.visible = this.groups.path.visible = options.floor;
      this.groups.cameras.visible = options.cameras;
      this.shine(index, places, options);
      this.draw();
    }

    between(a, b) {
      const from = new THREE.Vector3(...a), to = new THREE.Vector3(...b), along = to.clone().sub(from);
      const length = Math.max(along.length(), 1e-6);
      const turn = new THREE.Quaternion().setFromUnitVectors(new THREE.Vector3(0, 1, 0), along.divideScalar(length));
      return new THREE.Matrix4().compose(from.add(to).multiplyScalar(0.5), turn, new THREE.Vector3(1, length, 1));
    }

    ellipsoid(place, factor, enlarged) {
      const [a, b, c, d, e, f, g, h, i] = factor.map((value) => value * enlarged);
      return new THREE.Matrix4().set(a, b, c, place[0], d, e, f, place[1], g, h, i, place[2], 0, 0, 0, 1);
    }

    /** Rays of the pictures that were taken at this instant. */
    shine(index, places, options) {
      const { position, color } = this.beams.geometry.attributes;
      const middle = this.walk.middle(index);
      let count = 0, pictures = 0;
      for (const camera of options.rays && middle ? this.walk.cameras : []) {
        const { index: picture, off } = this.walk.picture(camera, this.walk.time[index]);
        if (Math.abs(off) * scene.time_steps > camera.near) continue;
        pictures++;
        const ink = new THREE.Color(camera.colour);
        for (let joint = 0; joint < this.walk.joints; joint++) {
          if (options.joint >= 0 && joint !== options.joint) continue;
          const at = 2 * (picture * this.walk.joints + joint);
          if (camera.slopes[at] === NONE) continue;
          const slope = [camera.slopes[at] / scene.ray_steps, camera.slopes[at + 1] / scene.ray_steps];
          const to = places[joint] || middle;
          const depth = to.reduce((sum, value, axis) => sum + (value - camera.centre[axis]) * camera.wRc[axis][2], 0);
          if (depth <= 0) continue;
          position.setXYZ(count, ...camera.centre);
          position.setXYZ(count + 1, ...this.seen(camera, slope, depth + RAY_BEYOND));
          for (const end of [count, count + 1]) color.setXYZ(end, ink.r, ink.g, ink.b);
          count += 2;
        }
      }
      this.beams.geometry.setDrawRange(0, count);
      position.needsUpdate = color.needsUpdate = true;
      this.lit = { rays: count / 2, pictures };
    }

    follow(index) {
      const from = this.walk.middle(this.at), to = this.walk.middle(index);
      if (!from || !to) return;
      const moved = new THREE.Vector3(to[0] - from[0], to[1] - from[1], 0);
      this.controls.target.add(moved);
      this.eye.position.add(moved);
      this.controls.update();
    }

    /** The whole walk and the cameras near it. */
    home(flying = true) {
      const [low, high] = this.box(), middle = low.map((value, axis) => (value + high[axis]) / 2);
      const target = new THREE.Vector3(middle[0], middle[1], 0.8), direction = new THREE.Vector3(0.45, -0.8, 0.45).normalize();
      const right = new THREE.Vector3(0, 0, 1).cross(direction).normalize(), up = direction.clone().cross(right);
      const slope = 0.86 * Math.tan((HOME_FOV * Math.PI) / 360);
      const ends = [0, 1].flatMap((x) => [0, 1].flatMap((y) => [0, 1.9].map((z) => [[low, high][x][0], [low, high][y][1], z])));
      const near = this.walk.cameras.map((camera) => camera.centre).filter((centre) => Math.hypot(centre[0] - middle[0], centre[1] - middle[1]) < NEAR);
      // so far away that each of them is in the picture
      const needed = [...ends, ...near].map((point) => {
        const from = new THREE.Vector3(...point).sub(target);
        const aside = Math.max(Math.abs(from.dot(right)) / this.eye.aspect, Math.abs(from.dot(up)));
        return aside / slope + from.dot(direction);
      });
      this.go(target.clone().addScaledVector(direction, Math.max(2.5, ...needed)), target, HOME_FOV, flying);
    }

    /** To where a camera is, with what it sees; of one that is far away only what is around the person. */
    fly(camera) {
      const centre = new THREE.Vector3(...camera.centre), ahead = new THREE.Vector3(...camera.wRc.map((row) => row[2]));
      const person = new THREE.Vector3(...(this.walk.middle(this.at) || this.box()[0]));
      const depth = Math.max(person.clone().sub(centre).dot(ahead), 0.5);
      // all of the picture is seen, also where it is wider than this window
      const half = Math.tan((camera.fov * Math.PI) / 360), wide = camera.size[0] / camera.size[1];
      const whole = half * Math.max(1, wide / this.eye.aspect) * 1.04;
      const far = depth > NEAR && AROUND / depth < whole;
      const target = far ? person : centre.clone().addScaledVector(ahead, depth);
      this.go(centre, target, (360 / Math.PI) * Math.atan(far ? AROUND / depth : whole), true);
    }

    go(position, target, fov, flying) {
      const from = { position: this.eye.position.clone(), target: this.controls.target.clone(), fov: this.eye.fov };
      const begun = performance.now(), flight = (this.flight = (this.flight || 0) + 1);
      // the time of a picture that was begun before this may lie before it
      const step = (now) => {
        if (flight !== this.flight) return;
        const share = flying && !still.matches ? Math.min(Math.max(now - begun, 0) / FLIGHT, 1) : 1;
        const eased = share * share * (3 - 2 * share);
        this.eye.position.lerpVectors(from.position, position, eased);
        this.controls.target.lerpVectors(from.target, target, eased);
        this.eye.fov = from.fov + (fov - from.fov) * eased;
        this.eye.updateProjectionMatrix();
        this.controls.update();
        this.draw();
        if (share < 1) requestAnimationFrame(step);
      };
      step(begun);
    }

    resize() {
      const { clientWidth: width, clientHeight: height } = this.canvas.parentElement;
      if (!width || !height) return;
      const first = this.width === undefined;
      this.width = width;
      this.height = height;
      this.renderer.setSize(width, height, false);
      this.eye.aspect = width / height;
      this.eye.updateProjectionMatrix();
      if (first) this.home(false);
      this.draw();
    }

    draw() {
      if (this.waiting) return;
      this.waiting = true;
      requestAnimationFrame(() => {
        this.waiting = false;
        this.renderer.render(this.world, this.eye);
        for (const [name, camera] of this.names) {
          const at = new THREE.Vector3(...camera.centre).project(this.eye);
          const inside = Math.abs(at.x) < 1 && Math.abs(at.y) < 1 && at.z < 1;
          name.hidden = !inside || !this.groups.cameras.visible;
          name.style.transform = `translate(${((at.x + 1) / 2) * this.width}px, ${((1 - at.y) / 2) * this.height}px) translate(-50%, -150%)`;
        }
      });
    }
  }

  function say(text) {
    const note = one("#note");
    note.textContent = text;
    note.hidden = !text;
  }

  function begin(walk) {
    const pictures = new Pictures(walk), slider = one("#slider"), play = one("#play");
    let space = null, at = 0, since = null, linking = 0;
    try {
      space = new Space(walk, one("#stage canvas"));
    } catch (error) {
      one("#stage").classList.add("without");
      say("This browser draws no 3D (WebGL is off); the pictures and the slider work.");
    }
    const options = () => ({
      sigmas: one("#sigmas").checked, floor: one("#floor").checked, cameras: one("#cameras").checked,
      rays: one("#rays").value !== "none", joint: scene.joints.indexOf(one("#rays").value),
      enlarged: Number(one("#enlarged").value), follow: one("#follow").checked,
    });

    function show(index, link = true) {
      at = Math.min(Math.max(index, 0), walk.count - 1);
      const number = walk.instants[at], seconds = walk.seconds(at).toFixed(3);
      slider.value = at;
      slider.setAttribute("aria-valuetext", `frame ${number}, ${seconds} s`);
      one("#number").textContent = `frame ${number}`;
      one("#number").href = `#frame=${number}`;
      one("#seconds").textContent = `${seconds} s of ${walk.seconds(walk.count - 1).toFixed(1)} s`;
      pictures.show(at);
      if (space) {
        const wanted = options();
        space.show(at, wanted);
        one("#lit").textContent = !wanted.rays ? "" : space.lit.pictures ? `${space.lit.rays} rays` : "no picture at this instant: go to the next one";
      }
      for (const item of document.querySelectorAll("#worst a")) {
        const [index] = wantedBy(item.hash);
        if (index === at) item.setAttribute("aria-current", "true");
        else item.removeAttribute("aria-current");
      }
      clearTimeout(linking);
      if (link) linking = setTimeout(() => history.replaceState(null, "", `#frame=${number}`), LINK_AFTER);
    }

    function stop() {
      since = null;
      play.textContent = "Play";
      play.setAttribute("aria-pressed", "false");
    }

    function tick(now) {
      if (since === null) return;
      const time = since.time + (Math.max(now - since.now, 0) / 1000) * Number(one("#speed").value) * scene.time_steps;
      const index = nearest(walk.time, time), ended = time >= walk.time[walk.count - 1];
      if (ended) stop();
      if (index !== at || ended) show(index);
      if (!ended) requestAnimationFrame(tick);
    }

    function start() {
      if (at === walk.count - 1) show(0);
      since = { now: performance.now(), time: walk.time[at] };
      play.textContent = "Pause";
      play.setAttribute("aria-pressed", "true");
      requestAnimationFrame(tick);
    }

    function toggle() {
      if (since === null) return start();
      stop();
      show(at);
    }

    function jump(index) {
      stop();
      show(index);
    }

    /** To the next, or the one before, of some indices; around at the end. */
    function among(indices, forwards) {
      const sorted = Array.from(new Set(indices)).sort((a, b) => a - b);
      const found = forwards ? sorted.find((index) => index > at) : sorted.reverse().find((index) => index < at);
      if (sorted.length) jump(found === undefined ? sorted[0] : found);
    }

    /** Index of the instant that a link names, and the camera that it names; -1 where there is none. */
    function wantedBy(hash) {
      const words = new URLSearchParams(hash.slice(1)), camera = words.get("camera");
      if (!words.has("frame") || !Number.isInteger(Number(words.get("frame")))) return [-1, camera];
      const frame = Number(words.get("frame"));
      return [camera ? walk.indexOfFrame(camera, frame) : walk.indexOfInstant(frame), camera];
    }

    function linked() {
      const [index, camera] = wantedBy(location.hash);
      if (index < 0 && location.hash.length > 1) say(`There is no such frame here: ${decodeURIComponent(location.hash.slice(1))}`);
      else if (space) say("");
      for (const [name, figure] of pictures.figures) figure.classList.toggle("named", name === camera && index >= 0);
      stop();
      show(index < 0 ? walk.first : index, false);
    }

    slider.max = walk.count - 1;
    slider.addEventListener("input", () => jump(Number(slider.value)));
    play.addEventListener("click", toggle);
    one("#speed").addEventListener("change", () => since !== null && start());
    one("#back").addEventListener("click", () => jump(at - 1));
    one("#on").addEventListener("click", () => jump(at + 1));
    const seen = walk.cameras.flatMap((camera) => Array.from(camera.pictureTimes, (time) => nearest(walk.time, time)));
    one("#picture-back").addEventListener("click", () => among(seen, false));
    one("#picture-on").addEventListener("click", () => among(seen, true));
    const worst = scene.moments.map(({ camera, frame }) => wantedBy(`#${camera ? `camera=${camera}&` : ""}frame=${frame}`)[0]);
    const ticks = one("#ticks");
    for (const index of worst) ticks.append(Object.assign(document.createElement("option"), { value: index }));
    if (worst.length) one("#worst-on").addEventListener("click", () => among(worst, true));
    for (const option of document.querySelectorAll("#shown input, #shown select")) {
      option.addEventListener("change", () => show(at, false));
    }
    one("#home").addEventListener("click", () => space && space.home());
    for (const camera of walk.cameras) {
      const button = pictures.figures.get(camera.name).querySelector("button");
      button.addEventListener("click", () => {
        if (space) space.fly(camera);
        one("#stage").scrollIntoView({ block: "nearest", behavior: still.matches ? "auto" : "smooth" });
      });
    }
    one("#stage canvas").addEventListener("keydown", (event) => {
      const keys = { " ": toggle, ArrowLeft: () => jump(at - 1), ArrowRight: () => jump(at + 1), Home: () => jump(0), End: () => jump(walk.count - 1) };
      if (!keys[event.key]) return;
      event.preventDefault();
      keys[event.key]();
    });
    matchMedia("(prefers-color-scheme: dark)").addEventListener("change", () => space && space.paint());
    addEventListener("hashchange", linked);
    linked();
    // for the console of a browser, and for tests
    window.viewer = { walk, space };
    main.dataset.ready = "yes";
  }

  if (!scene || !scene.numbers) return say("scene.js is missing beside this page.");
  if (typeof DecompressionStream === "undefined") return say("This browser is too old for this page.");
  numbersOf(scene.numbers, scene.parts).then((numbers) => begin(new Walk(numbers)));
})();
