// A jig that holds the vehicle while its legs are set: hips on the tower, one foot in each hole. Millimetres.
//
// Origin: below the middle of the vehicle, in the plane that the feet stand on. `make cad` takes the first four numbers
// from the gear file.

length_mm = 50;               // leg.length
angle_deg = 60;               // leg.angle
hip_xy_mm = 17;               // leg.hip_xy
foot_radius_mm = 2;           // leg.foot_radius

base_mm = 4;                  // thickness of the base, above the plane of the feet
clearance_mm = 0.25;          // around a foot
free_mm = 4.5;                // between tower and hips

foot_xy_mm = hip_xy_mm + length_mm * sin(angle_deg) / sqrt(2);
tower_mm = length_mm * cos(angle_deg);
side_mm = 2 * (foot_xy_mm + foot_radius_mm + 6);
$fn = 48;

difference() {
    union() {
        translate([-side_mm / 2, -side_mm / 2, 0]) cube([side_mm, side_mm, base_mm]);
        translate([free_mm - hip_xy_mm, free_mm - hip_xy_mm, 0])
            cube([2 * (hip_xy_mm - free_mm), 2 * (hip_xy_mm - free_mm), tower_mm]);
    }
    for (x = [-1, 1], y = [-1, 1])
        translate([x * foot_xy_mm, y * foot_xy_mm, -1]) cylinder(r = foot_radius_mm + clearance_mm, h = base_mm + 2);
}
