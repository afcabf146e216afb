// A leg that prints flat, in one piece: plate, leaf hinge, rod, foot. Millimetres.
//
// Origin: the hip, in the middle of the leaf. x: outward, y: up along the body's z, z: across the leg.
// Print it as it lies: the layers run along the leaf. `make cad` takes the first five numbers from the gear file.

length_mm = 50;               // leg.length: hip to foot
angle_deg = 60;               // leg.angle: from straight down, outward
stiffness_Nm_per_rad = 0.08;  // leg.stiffness
mass_g = 0.44;                // leg.mass: of the rod
foot_radius_mm = 2;           // leg.foot_radius

modulus_MPa = 3000;           // of the plastic: PLA 3000, PETG 2000
density_g_per_cm3 = 1.24;     // PLA 1.24, PETG 1.27
width_mm = 4;                 // of all parts, across the leg
leaf_mm = 6.4;                // free length of the leaf

plate_mm = [12, 2.4];         // screwed or glued under the body
hole_mm = 1.7;                // two holes, for M1.6

// a leaf of length l, width b, thickness t: k = E b t^3 / (12 l)
leaf_thick_mm = pow(12 * leaf_mm * 1000 * stiffness_Nm_per_rad / (modulus_MPa * width_mm), 1 / 3);
rod_thick_mm = 1000 * mass_g / (density_g_per_cm3 * length_mm * width_mm);
$fn = 48;

// In the leg's own axes: the hip at the origin, the foot at (0, -length).
module leaf_rod_foot() {
    translate([-leaf_thick_mm / 2, -leaf_mm / 2 - 0.1]) square([leaf_thick_mm, leaf_mm + 0.2]);
    translate([-rod_thick_mm / 2, -length_mm]) square([rod_thick_mm, length_mm - leaf_mm / 2]);
    translate([0, -length_mm]) circle(foot_radius_mm);
}

module block() {
    hull() {
        rotate(angle_deg) translate([0, leaf_mm / 2 + 0.9]) circle(1.0);
        translate([-plate_mm[0], plate_y_mm]) square(plate_mm);
    }
}

// the plate lies above the leaf's end, whatever the angle
plate_y_mm = leaf_mm / 2 * cos(angle_deg) + 1.2;

difference() {
    linear_extrude(width_mm) {
        rotate(angle_deg) leaf_rod_foot();
        block();
    }
    for (x = [-plate_mm[0] + 2.2, -plate_mm[0] / 2 - 0.4])
        translate([x, plate_y_mm + plate_mm[1] / 2, width_mm / 2]) rotate([90, 0, 0])
            cylinder(d = hole_mm, h = 30, center = true);
}
