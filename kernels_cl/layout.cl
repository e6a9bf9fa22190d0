// Records that pass between the kernels of one frame.
//
// Shapes in comments: K Gaussians, V visible ones, E entries of a band, H x W pixels. Gaussians are indexed by *position* in
// storage, by *rank* in depth order, or by *row* of the model; only `rows` and `records` are by row.
//
// A *splat* is the input of blending: SPLAT floats per Gaussian (a multiple of 16, one cache line or more), indexed by the
// Gaussian's position in storage. With d = pixel - (U, V), in pixels:
//   ewa:  log2 alpha = LOG2_OPACITY - Q,          Q = (A dx + B dy)^2 + (C dy)^2
//   ray:  log2 alpha = LOG2_OPACITY - G K / N,    K = (A dx + B dy + A0)^2 + (C dy + C0)^2,
//         N = L^2 + K,  L = L0 + LX dx + LY dy,   depth of the maximum: t* = L / N
//         and at a depth t before t*: less by G N (t* - t)^2 (opacity_field.cl)
// Q, K and N are sums of squares: never negative, and precise for needles, where the expanded polynomial is the small
// difference of large terms. K / N is the squared sine of the angle between the pixel's ray and the centre's ray as the
// whitened Gaussian sees them; G, the largest exponent, belongs to the camera's own position.
// (U, V) is the projected centre. For `ray` it is the nearest point of the image, so that offsets keep their digits for
// centres near the camera plane; A0 and C0 are 0 where the two are the same.
// Channels (colour or features) follow.
//
// A *footprint* is the input of binning: an ellipse {d : d' S^-1 d <= 1} around (X, Y) that holds every pixel with
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
#if RAY
#define SPLAT_G 6
#define SPLAT_LX 7
#define SPLAT_LY 8
#define SPLAT_L0 9
#define SPLAT_A0 10
#define SPLAT_C0 11
#define SPLAT_CHANNELS 12
#else
#define SPLAT_DEPTH 6  // of the centre
#define SPLAT_CHANNELS 7
#endif
#define SPLAT ((SPLAT_CHANNELS + CHANNELS + 15) / 16 * 16)

// A *slot gradient* is the result of the backward pass for an entry: MOMENTS moments of dL/d(log2 alpha) over the tile's
// pixels (1, a, b, a^2, a b, b^2 with a = A dx + B dy, b = C dy), and dL/dchannel.
#define SLOT_GRADIENT (MOMENTS + CHANNELS)

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

// Camera numbers, in the order of gspure.cameras.Camera.numbers, then the camera's centre, both relative to the origin,
// which comes last (gspure.opencl.projection.camera_numbers).
#define CAMERA_FX camera[2]
#define CAMERA_FY camera[3]
#define CAMERA_CX camera[4]
#define CAMERA_CY camera[5]
#define CAMERA_VIEW(row, column) camera[6 + 4 * (row) + (column)]
#define CAMERA_CENTRE(axis) camera[18 + (axis)]
#define CAMERA_ORIGIN(axis) camera[21 + (axis)]
