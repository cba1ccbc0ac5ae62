// Where a ray meets one shape. No pass, no binding. Twin of `cast` in crates/cpu/src/query/shapes.rs.
//
// Balls after Haines, Günther and Akenine-Möller, "Precision Improvements for Ray/Sphere Intersection" (Ray Tracing
// Gems, 2019).

//#import shared/collider.wgsl
//#import shared/math.wgsl
//#import shared/query.wgsl

// More than every distance.
const MISSED: f32 = 3e38;

// Stands for the inverse of a component that is nothing.
const STEEP: f32 = 1e20;

struct Hit {
    distance: f32, // MISSED when there is none
    normal: vec3<f32>, // against the ray; zero where it begins inside a solid shape
}

fn missed() -> Hit {
    return Hit(MISSED, vec3<f32>());
}

// Where the ray meets the shape, however far.
fn cast_shape(shape: PlacedShape, ray: QueryRay) -> Hit {
    let origin = ray.origin - shape.position;
    if shape.shape == SHAPE_BALL {
        return cast_ball(shape.size.x, origin, ray);
    }
    if shape.shape == SHAPE_CUBOID {
        let direction = rotate_back(shape.rotation, ray.direction);
        let hit = cast_cuboid(shape.size, rotate_back(shape.rotation, origin), direction, ray.solid);
        return Hit(hit.distance, rotate(shape.rotation, hit.normal));
    }
    return cast_halfspace(rotate(shape.rotation, vec3<f32>(0.0, 1.0, 0.0)), origin, ray);
}

fn cast_ball(radius: f32, origin: vec3<f32>, ray: QueryRay) -> Hit {
    // The point of the ray's line that is nearest to the middle, and how far the surface is from there.
    let middle = -dot(origin, ray.direction);
    let aside = origin + middle * ray.direction;
    let square = radius * radius - dot(aside, aside);
    let inside = dot(origin, origin) <= radius * radius;
    if inside && ray.solid != 0u {
        return Hit(0.0, vec3<f32>());
    }
    if square < 0.0 || (!inside && middle < 0.0) {
        return missed();
    }
    let half_chord = sqrt(square);
    let distance = max(select(middle - half_chord, middle + half_chord, inside), 0.0);
    let out = (origin + distance * ray.direction) / radius;
    return Hit(distance, select(out, -out, inside));
}

// In the cuboid's frame.
fn cast_cuboid(size: vec3<f32>, origin: vec3<f32>, direction: vec3<f32>, solid: u32) -> Hit {
    let inverse = vec3<f32>(steep(direction.x), steep(direction.y), steep(direction.z));
    let low = (-size - origin) * inverse;
    let high = (size - origin) * inverse;
    let into = min(low, high);
    let out = max(low, high);
    let near = max_element(into);
    let far = min_element(out);
    if near > far || far < 0.0 {
        return missed();
    }
    if near >= 0.0 {
        return Hit(near, against(direction, first(into, near)));
    }
    if solid != 0u {
        return Hit(0.0, vec3<f32>());
    }
    return Hit(far, against(direction, first(out, far)));
}

fn steep(x: f32) -> f32 {
    if abs(x) > 1.0 / STEEP {
        return 1.0 / x;
    }
    return select(STEEP, -STEEP, x < 0.0);
}

// The first axis along which `v` is `value`, as a unit vector.
fn first(v: vec3<f32>, value: f32) -> vec3<f32> {
    if v.x == value {
        return vec3<f32>(1.0, 0.0, 0.0);
    }
    return select(vec3<f32>(0.0, 0.0, 1.0), vec3<f32>(0.0, 1.0, 0.0), v.y == value);
}

fn against(direction: vec3<f32>, axis: vec3<f32>) -> vec3<f32> {
    return select(axis, -axis, dot(direction, axis) > 0.0);
}

fn cast_halfspace(normal: vec3<f32>, origin: vec3<f32>, ray: QueryRay) -> Hit {
    let height = dot(normal, origin);
    let climb = dot(normal, ray.direction);
    if height < 0.0 && ray.solid != 0u {
        return Hit(0.0, vec3<f32>());
    }
    if abs(climb) <= 1.0 / STEEP {
        return missed();
    }
    let distance = -height / climb;
    if distance < 0.0 {
        return missed();
    }
    return Hit(distance, select(normal, -normal, height < 0.0));
}
