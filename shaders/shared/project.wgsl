// The nearest point of one shape. No pass, no binding. Twin of `project` in crates/cpu/src/query/shapes.rs.

//#import shared/collider.wgsl
//#import shared/math.wgsl
//#import shared/query.wgsl

struct Projected {
    nearest: vec3<f32>, // point of the shape
    square: f32, // of its distance
}

// The point of a solid shape that is nearest to `point`.
fn project(shape: PlacedShape, point: vec3<f32>) -> Projected {
    let from_origin = point - shape.position;
    if shape.shape == SHAPE_BALL {
        let far = length(from_origin);
        let gap = far - shape.size.x;
        if gap <= 0.0 {
            return Projected(point, 0.0);
        }
        return Projected(shape.position + from_origin * (shape.size.x / far), gap * gap);
    }
    if shape.shape == SHAPE_CUBOID {
        let local = rotate_back(shape.rotation, from_origin);
        let nearest = min(max(local, -shape.size), shape.size);
        let out = local - nearest;
        let square = dot(out, out);
        if square == 0.0 {
            return Projected(point, 0.0);
        }
        return Projected(shape.position + rotate(shape.rotation, nearest), square);
    }
    let normal = rotate(shape.rotation, vec3<f32>(0.0, 1.0, 0.0));
    let height = dot(normal, from_origin);
    if height <= 0.0 {
        return Projected(point, 0.0);
    }
    return Projected(point - normal * height, height * height);
}
