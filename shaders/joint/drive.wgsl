// Limits, motors and friction of one axis of a joint, and the springs of soft joints. Twin of
// crates/cpu/src/joint/drive.rs, which says what pieces are. No pass, no binding.

//#import shared/joint.wgsl

const PIECE_FIXED: u32 = 0u;
const PIECE_LOCKED: u32 = 1u;
const PIECE_LOW: u32 = 2u;
const PIECE_HIGH: u32 = 3u;
const PIECE_STUCK: u32 = 4u;
const PIECE_SOFT: u32 = 5u;

const TAU: f32 = 6.2831855;

// Velocity + gamma impulse = goal where the row is active, else impulse = goal.
struct Piece {
    kind: u32,
    gamma: f32,
    goal: f32,
}

// Where an axis is, and what moves it.
struct AxisState {
    coordinate: f32,
    velocity: f32,
    impulse: f32,
    response: f32,
}

// Impulse = start - slope velocity, between -most and most.
struct Motor {
    start: f32,
    slope: f32,
    most: f32,
}

// The piece that holds for an axis of a joint over a sub-step of length h, where `was` held before: no choice leaps from one
// limit to the other. The impulses of motors, friction and springs are `share` of those of the sub-step.
fn piece(axes: u32, flags: u32, frequency: f32, damping_ratio: f32, drive: JointDrive, axis: u32, at: AxisState, h: f32, share: f32, was: u32) -> Piece {
    if at.response <= 0.0 {
        return Piece(PIECE_FIXED, 0.0, 0.0);
    }
    if ((axes >> (JOINT_LOCKED + axis)) & 1u) != 0u {
        return locked_piece(flags, frequency, damping_ratio, at, h, share);
    }
    let limited = ((axes >> (JOINT_LIMITED + axis)) & 1u) != 0u;
    if limited && drive.low == drive.high {
        return Piece(PIECE_LOCKED, 0.0, -(at.coordinate - drive.low) / h);
    }
    let motor = motor_of(axes, flags, drive, axis, at, h, share);
    let rub = drive.friction * h * share;
    let free = at.velocity - at.response * at.impulse;
    if limited {
        let to_low = min((drive.low - at.coordinate) / h, 0.0);
        let to_high = max((drive.high - at.coordinate) / h, 0.0);
        if was != PIECE_HIGH && (to_low - free) / at.response > motor_impulse(motor, to_low) + select(rub, -rub, to_low > 0.0) {
            return Piece(PIECE_LOW, 0.0, to_low);
        }
        if was != PIECE_LOW && (to_high - free) / at.response < motor_impulse(motor, to_high) - select(rub, -rub, -to_high > 0.0) {
            return Piece(PIECE_HIGH, 0.0, to_high);
        }
    }
    let more = (0.0 - free) / at.response - motor_impulse(motor, 0.0);
    if rub > 0.0 && abs(more) <= rub {
        return Piece(PIECE_STUCK, 0.0, 0.0);
    }
    let rubbed = select(-rub, rub, more > 0.0);
    let velocity = (free + at.response * (motor.start + rubbed)) / (1.0 + at.response * motor.slope);
    let impulse = motor.start - motor.slope * velocity;
    if motor.slope > 0.0 && abs(impulse) <= motor.most {
        let gamma = 1.0 / motor.slope;
        return Piece(PIECE_SOFT, gamma, gamma * (motor.start + rubbed));
    }
    return Piece(PIECE_FIXED, 0.0, clamp(impulse, -motor.most, motor.most) + rubbed);
}

// A locked axis, hard or soft.
fn locked_piece(flags: u32, frequency: f32, damping_ratio: f32, at: AxisState, h: f32, share: f32) -> Piece {
    if (flags & JOINT_SOFT) == 0u {
        return Piece(PIECE_LOCKED, 0.0, -at.coordinate / h);
    }
    let mass = 1.0 / at.response;
    let stiffness = frequency * frequency * mass;
    let damping = 2.0 * damping_ratio * frequency * mass;
    let gamma = 1.0 / (h * (damping + h * stiffness));
    return Piece(PIECE_SOFT, gamma / share, -gamma * h * stiffness * at.coordinate);
}

// The implicit spring and damper; nothing where there is none.
fn motor_of(axes: u32, flags: u32, drive: JointDrive, axis: u32, at: AxisState, h: f32, share: f32) -> Motor {
    if ((axes >> (JOINT_MOTOR + axis)) & 1u) == 0u {
        return Motor(0.0, 0.0, 0.0);
    }
    let forced = ((flags >> (JOINT_FORCE_BASED + axis)) & 1u) != 0u;
    let mass = select(1.0 / at.response, 1.0, forced);
    let stiffness = mass * drive.stiffness;
    let damping = mass * drive.damping;
    var off = at.coordinate - drive.target_pos;
    if axis >= 3u {
        // The shorter way round.
        off -= TAU * round(off / TAU);
    }
    let given = h * share;
    let start = given * (damping * drive.target_vel - stiffness * off);
    return Motor(start, given * (damping + h * stiffness), drive.max_force * given);
}

fn motor_impulse(motor: Motor, velocity: f32) -> f32 {
    return clamp(motor.start - motor.slope * velocity, -motor.most, motor.most);
}
