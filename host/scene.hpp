// What the two sides of `medium` share. Private to the library.
#pragma once

#include "clratio/medium.hpp"

namespace clratio {

/// The camera's axes: forward of length 1, right and up as long as half the image at distance 1.
struct CameraAxes {
    Vector3 forward, right, up;
};
CameraAxes axes_of(const Camera& camera, Frame frame);

void check_frame(Frame frame);

/// Rows with their count put in. Errors: InvalidArgument for rows outside the frame.
Rows checked(Rows rows, Frame frame);

/// Channels by sigma_t, those without light last: the order in which mixtures and kernels take them.
std::array<std::size_t, 3> channel_order(const Medium& medium);

/// The Henyey-Greenstein phase function.
double phase_of(double g, double cosine);

}  // namespace clratio
