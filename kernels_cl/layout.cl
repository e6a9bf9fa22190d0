// Records that pass between the kernels of one frame.
//
// A *splat* is what a pixel needs of a Gaussian: SPLAT floats (a multiple of 16, one cache line or more), indexed by the
// Gaussian's position in storage. With d = pixel - (U, V), in pixels:
//   ewa:  log2 alpha = LOG2_OPACITY - Q,      Q = (A dx + B dy)^2 + (C dy)^2
//   ray:  log2 alpha = LOG2_OPACITY - Q / N,
//         N = 1 + 2 (LX dx + LY dy) + MXX dx^2 + 2 MXY dx dy + MYY dy^2 = |direction|^2 relative to the centre's ray
//         and before the maximum's depth t*, at depth t: further STEEPNESS N (t* - t)^2 less (POINTS)
// As a sum of squares Q is never negative, and keeps its digits for needles, where XX dx^2 + XY dx dy + YY dy^2 is the small
// difference of large terms.
// Channels (colour or features) follow.
//
// A *footprint* is what tiles need: an ellipse {d : d' S^-1 d <= 1} around (X, Y) that holds every pixel with
// alpha >= ALPHA_MIN, and its tile rectangle. At height y over the centre the ellipse spans
// SLOPE y +- sqrt(WIDTH2 (1 - y^2 INVERSE_SYY)) in x; its rightmost point lies at Y_EXTREME, its leftmost at -Y_EXTREME.
// INVERSE_SYY = 0 marks a footprint that is no ellipse (the Gaussian reaches behind the camera, or nearly): its rectangle
// is the image.

#define SPLAT_U 0
#define SPLAT_V 1
#define SPLAT_A 2
#define SPLAT_B 3
#define SPLAT_C 4
#define SPLAT_LOG2_OPACITY 5
#define SPLAT_DEPTH 6
#if RAY
#define SPLAT_LX 7
#define SPLAT_LY 8
#define SPLAT_MXX 9
#define SPLAT_MXY 10
#define SPLAT_MYY 11
#if POINTS
#define SPLAT_STEEPNESS 12
#define SPLAT_CHANNELS 13
#else
#define SPLAT_CHANNELS 12
#endif
#else
#define SPLAT_CHANNELS 7
#endif
#define SPLAT ((SPLAT_CHANNELS + CHANNELS + 15) / 16 * 16)

// A *slot gradient* is what the backward pass keeps per entry: the moments of dL/d(log2 alpha) over the tile's pixels (1,
// a, b, a^2, a b, b^2 with a = A dx + B dy, b = C dy), and dL/dchannel.
#define MOMENTS 6
#define SLOT_GRADIENT (MOMENTS + CHANNELS)

#define FOOTPRINT 8
#define FOOTPRINT_X 0
#define FOOTPRINT_Y 1
#define FOOTPRINT_SLOPE 2
#define FOOTPRINT_Y_EXTREME 3
#define FOOTPRINT_INVERSE_SYY 4
#define FOOTPRINT_TILES_X 5  // first | last << 16, both inclusive
#define FOOTPRINT_TILES_Y 6
#define FOOTPRINT_WIDTH2 7  // SXX - SXY^2 / SYY, free of cancellation

// Depth key of a Gaussian that is not drawn; positive floats order as their bits do.
#define NOT_VISIBLE 0xffffffffu

// Pixel centres lie at +0.5; footprints are widened by this many pixels against rounding, and by half a pixel more where
// they have to hold every point of a pixel.
#if POINTS
#define FOOTPRINT_MARGIN 0.52f
#else
#define FOOTPRINT_MARGIN 0.02f
#endif

// Camera numbers, in the order of gspure.cameras.Camera.numbers and then the camera's centre.
#define CAMERA_FX camera[2]
#define CAMERA_FY camera[3]
#define CAMERA_CX camera[4]
#define CAMERA_CY camera[5]
#define CAMERA_VIEW(row, column) camera[6 + 4 * (row) + (column)]
#define CAMERA_CENTRE(axis) camera[18 + (axis)]
