// Every lens model of every calibration format, against pixels that were computed apart from this program from the
// format's published formula: COLMAP's src/colmap/sensor/models.h, OpenSfM's src/geometry, Metashape's
// manual (appendix "Camera models"), basalt-headers' camera/, nerfstudio's Cameras, camodocal's camera_models/
// (VINS), Kalibr's wiki (supported models), OpenCV's calib3d, fisheye and omnidir, ROS's sensor_msgs/CameraInfo.
#include <gmock/gmock.h>
#include <gtest/gtest.h>

#include <array>
#include <string>
#include <vector>

#include "tests/refusal.h"
#include "tests/temporary_folder.h"
#include "tileflight/core/base/files.h"
#include "tileflight/core/imaging/calibration_files.h"

namespace tileflight::imaging::lens_formulas_test {
namespace {

using geometry::Vec2;
using geometry::Vec3;
using testing::HasSubstr;

struct Oracle {
  std::string name, text;
  std::array<std::array<double, 2>, 3> pixels;  ///< of kPoints; pixel centres at integers
};

const std::array<Vec3, 3> kPoints{Vec3(0.1, 0.2, 1.0), Vec3(-0.4, 0.3, 1.2), Vec3(0.35, -0.3, 1.0)};

const std::vector<Oracle> kOracles{
    {"colmap SIMPLE_PINHOLE",
     "1 SIMPLE_PINHOLE 640 480 500 321 241",
     {{{370.500000000, 340.500000000}, {153.833333333, 365.500000000}, {495.500000000, 90.500000000}}}},
    {"colmap PINHOLE",
     "1 PINHOLE 640 480 500 510 321 241",
     {{{370.500000000, 342.500000000}, {153.833333333, 368.000000000}, {495.500000000, 87.500000000}}}},
    {"colmap SIMPLE_RADIAL",
     "1 SIMPLE_RADIAL 640 480 500 321 241 -0.05",
     {{{370.375000000, 340.250000000}, {155.280092593, 364.414930556}, {493.640625000, 92.093750000}}}},
    {"colmap RADIAL",
     "1 RADIAL 640 480 500 321 241 -0.05 0.02",
     {{{370.377500000, 340.255000000}, {155.179623200, 364.490282600}, {493.798671875, 91.958281250}}}},
    {"colmap OPENCV",
     "1 OPENCV 640 480 500 510 321 241 -0.05 0.02 0.001 -0.002",
     {{{370.327500000, 342.275600000}, {154.700456533, 367.292379919}, {493.236171875, 89.401821875}}}},
    {"colmap FULL_OPENCV",
     "1 FULL_OPENCV 640 480 500 510 321 241 -0.05 0.02 0.001 -0.002 0.003 0.01 -0.004 0.005",
     {{{370.303059593, 342.225741569}, {154.968807991, 367.087091054}, {492.896613920, 89.698692544}}}},
    {"colmap OPENCV_FISHEYE",
     "1 OPENCV_FISHEYE 640 480 300 310 321 241 0.01 0.02 -0.003 0.004",
     {{{350.030140849, 301.528957755}, {225.557272737, 314.080613629}, {419.137753031, 153.135133030}}}},
    {"colmap SIMPLE_RADIAL_FISHEYE",
     "1 SIMPLE_RADIAL_FISHEYE 640 480 300 321 241 0.01",
     {{{350.028767750, 299.557535501}, {225.602454100, 311.673159425}, {419.070694510, 156.010833277}}}},
    {"colmap RADIAL_FISHEYE",
     "1 RADIAL_FISHEYE 640 480 300 321 241 0.01 0.02",
     {{{350.030150237, 299.560300474}, {225.556420164, 311.707684877}, {419.139193169, 155.952120141}}}},
    {"colmap FOV",
     "1 FOV 640 480 400 410 321 241 0.9",
     {{{362.788376425, 327.191171672}, {184.429180588, 345.104442423}, {461.885132721, 116.283061967}}}},
    {"colmap THIN_PRISM_FISHEYE",
     "1 THIN_PRISM_FISHEYE 640 480 300 310 321 241 0.01 0.02 0 0 -0.003 0.004 0 0",
     {{{350.030140849, 301.528957755}, {225.557272737, 314.080613629}, {419.137753031, 153.135133030}}}},
    {"colmap RAD_TAN_THIN_PRISM_FISHEYE",
     "1 RAD_TAN_THIN_PRISM_FISHEYE 640 480 300 310 321 241 0.01 0.02 -0.003 0.004 0 0 0 0 0 0 0 0",
     {{{350.030140849, 301.528957755}, {225.557272737, 314.080613629}, {419.137753031, 153.135133030}}}},
    {"colmap SIMPLE_FISHEYE",
     "1 SIMPLE_FISHEYE 640 480 300 321 241",
     {{{350.014484301, 299.528968603}, {225.750131272, 311.562401546}, {418.887127270, 156.168176625}}}},
    {"colmap FISHEYE",
     "1 FISHEYE 640 480 300 310 321 241",
     {{{350.014484301, 301.496600889}, {225.750131272, 313.931148264}, {418.887127270, 153.357115846}}}},
    {"colmap DIVISION",
     "1 DIVISION 640 480 500 510 321 241 0",
     {{{370.500000000, 342.500000000}, {153.833333333, 368.000000000}, {495.500000000, 87.500000000}}}},
    {"colmap EUCM",
     "1 EUCM 640 480 300 310 321 241 0.6 1.1",
     {{{350.019448252, 301.506859720}, {225.694402722, 313.974337891}, {418.957887237, 153.294442733}}}},
    {"colmap EQUIRECTANGULAR",
     "1 EQUIRECTANGULAR 640 480 640 480",
     {{{329.652165578, 269.513972620}, {286.726757648, 275.079636792}, {353.793415501, 197.340351908}}}},
    {"OpenSfM perspective",
     R"({"c": {"projection_type": "perspective", "width": 5472, "height": 3648, "focal": 0.66, "k1": 0.01, "k2": -0.02}})",
     {{{3096.814518400, 2546.129036800}, {1530.295694444, 2727.403229167}, {4001.076489100, 738.720152200}}}},
    {"OpenSfM simple_radial",
     R"({"c": {"projection_type": "simple_radial", "width": 5472, "height": 3648, "focal_x": 0.66, "focal_y": 0.67, "c_x": 0.001, "c_y": -0.002, "k1": 0.01}})",
     {{{3102.304576000, 2546.170624000}, {1535.042000000, 2730.707250000}, {4007.690068000, 710.346772000}}}},
    {"OpenSfM radial",
     R"({"c": {"projection_type": "radial", "width": 5472, "height": 3648, "focal_x": 0.66, "focal_y": 0.67, "c_x": 0.001, "c_y": -0.002, "k1": 0.01, "k2": -0.02}})",
     {{{3102.286518400, 2546.133961600}, {1535.767694444, 2730.154732639}, {4006.548489100, 711.340093900}}}},
    {"OpenSfM brown",
     R"({"c": {"projection_type": "brown", "width": 5472, "height": 3648, "focal_x": 0.66, "focal_y": 0.67, "c_x": 0.001, "c_y": -0.002, "k1": 0.01, "k2": -0.02, "p1": 0.0003, "p2": -0.0002, "k3": 0.015}})",
     {{{3102.279972520, 2546.248989880}, {1535.206714980, 2730.677317004}, {4006.172448397, 711.767465062}}}},
    {"OpenSfM fisheye",
     R"({"c": {"projection_type": "fisheye", "width": 3000, "height": 4000, "focal": 0.5, "k1": 0.02, "k2": -0.01}})",
     {{{1696.449066375, 2393.398132750}, {866.018625974, 2474.611030520}, {2157.633416131, 1435.385643317}}}},
    {"OpenSfM fisheye_opencv",
     R"({"c": {"projection_type": "fisheye_opencv", "width": 5472, "height": 3648, "focal_x": 0.5, "focal_y": 0.51, "c_x": 0.001, "c_y": -0.002, "k1": 0.02, "k2": -0.01, "k3": 0.003, "k4": -0.004}})",
     {{{3010.398408421, 2362.185873179}, {1874.361704865, 2475.512875778}, {3641.311647320, 1025.401908343}}}},
    {"OpenSfM fisheye62",
     R"({"c": {"projection_type": "fisheye62", "width": 5472, "height": 3648, "focal_x": 0.5, "focal_y": 0.51, "c_x": 0.001, "c_y": -0.002, "k1": 0.02, "k2": -0.01, "k3": 0.003, "k4": -0.004, "k5": 0, "p1": 0}})",
     {{{3010.398408421, 2362.185873179}, {1874.361704865, 2475.512875778}, {3641.311647320, 1025.401908343}}}},
    {"OpenSfM spherical",
     R"({"c": {"projection_type": "spherical", "width": 4000, "height": 1600, "focal": 1}})",
     {{{2062.951034861, 924.558219252}, {1794.667235301, 947.748486634}, {2213.833846880, 623.834799616}}}},
    {"Metashape frame",
     "<calibration><projection>frame</projection><width>4000</width><height>2250</height><f>3000.5</f><cx>10.5</"
     "cx><cy>-5.5</cy><b1>2.5</b1><k1>-0.01</k1><k2>0.02</k2><k3>-0.001</k3><p1>0.0004</p1><p2>-0.0002</p2></"
     "calibration>",
     {{{2310.224887463, 1718.799874988}, {1010.715241062, 1867.891732172}, {3060.431337717, 219.470927103}}}},
    {"Metashape fisheye",
     "<calibration><projection>fisheye</projection><width>4000</width><height>2250</height><f>1200</f><cx>10.5</"
     "cx><cy>-5.5</cy><b1>2.5</b1><k1>-0.01</k1><k2>0.02</k2><k3>-0.001</k3><k4>0.0005</k4></calibration>",
     {{{2128.252166799, 1355.012640597}, {1630.619688718, 1402.943684120}, {2403.904846155, 782.069213862}}}},
    {"Metashape spherical",
     "<calibration><projection>spherical</projection><width>4000</width><height>2000</height></calibration>",
     {{{2062.951034861, 1124.558219252}, {1794.667235301, 1147.748486634}, {2213.833846880, 823.834799616}}}},
    {"basalt ds",
     R"({"value0": {"T_imu_cam": [{"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}], "resolution": [[640, 480]], "intrinsics": [{"camera_type": "ds", "intrinsics": {"fx": 300, "fy": 310, "cx": 321, "cy": 241, "xi": -0.2, "alpha": 0.6}}]}})",
     {{{357.874586393, 317.207478546}, {202.752885692, 332.641513589}, {443.747725386, 132.280586087}}}},
    {"basalt eucm",
     R"({"value0": {"T_imu_cam": [{"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}], "resolution": [[640, 480]], "intrinsics": [{"camera_type": "eucm", "intrinsics": {"fx": 300, "fy": 310, "cx": 321, "cy": 241, "alpha": 0.6, "beta": 1.1}}]}})",
     {{{350.519448252, 302.006859720}, {226.194402722, 314.474337891}, {419.457887237, 153.794442733}}}},
    {"basalt ucm",
     R"({"value0": {"T_imu_cam": [{"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}], "resolution": [[640, 480]], "intrinsics": [{"camera_type": "ucm", "intrinsics": {"fx": 300, "fy": 310, "cx": 321, "cy": 241, "alpha": 0.6}}]}})",
     {{{350.561978802, 302.094756190}, {225.761904762, 314.809523810}, {419.992961911, 153.320519450}}}},
    {"basalt kb4",
     R"({"value0": {"T_imu_cam": [{"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}], "resolution": [[640, 480]], "intrinsics": [{"camera_type": "kb4", "intrinsics": {"fx": 300, "fy": 310, "cx": 321, "cy": 241, "k1": 0.01, "k2": 0.02, "k3": -0.003, "k4": 0.004}}]}})",
     {{{350.530140849, 302.028957755}, {226.057272737, 314.580613629}, {419.637753031, 153.635133030}}}},
    {"basalt fov",
     R"({"value0": {"T_imu_cam": [{"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}], "resolution": [[640, 480]], "intrinsics": [{"camera_type": "fov", "intrinsics": {"fx": 300, "fy": 310, "cx": 321, "cy": 241, "w": 0.9}}]}})",
     {{{352.716282319, 306.546983459}, {218.946885441, 320.091163783}, {427.038849540, 147.079876121}}}},
    {"basalt pinhole-radtan8",
     R"({"value0": {"T_imu_cam": [{"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}], "resolution": [[640, 480]], "intrinsics": [{"camera_type": "pinhole-radtan8", "intrinsics": {"fx": 300, "fy": 310, "cx": 321, "cy": 241, "k1": -0.05, "k2": 0.02, "p1": 0.001, "p2": -0.002, "k3": 0.003, "k4": 0.01, "k5": -0.004, "k6": 0.005, "rpmax": 2.5}}]}})",
     {{{350.881835756, 302.833293895}, {221.681284795, 317.945094562}, {424.437968352, 149.336460174}}}},
    {"nerf OPENCV",
     R"({"w": 640, "h": 480, "camera_model": "OPENCV", "fl_x": 500, "fl_y": 510, "cx": 321, "cy": 241, "k1": -0.05, "k2": 0.02, "p1": 0.001, "p2": -0.002, "k3": 0.003, "frames": []})",
     {{{370.327518750, 342.275638250}, {154.697840142, 367.294381458}, {493.241209619, 89.397417447}}}},
    {"nerf distortion_params",
     R"({"w": 640, "h": 480, "camera_model": "OPENCV", "fl_x": 500, "fl_y": 510, "cx": 321, "cy": 241, "k1": 9, "distortion_params": [-0.05, 0.02, 0.003, 0, 0.001, -0.002], "frames": []})",
     {{{370.327518750, 342.275638250}, {154.697840142, 367.294381458}, {493.241209619, 89.397417447}}}},
    {"nerf OPENCV_FISHEYE",
     R"({"w": 640, "h": 480, "camera_model": "OPENCV_FISHEYE", "fl_x": 300, "fl_y": 310, "cx": 321, "cy": 241, "k1": 0.01, "k2": 0.02, "k3": -0.003, "k4": 0.004, "frames": []})",
     {{{350.030140849, 301.528957755}, {225.557272737, 314.080613629}, {419.137753031, 153.135133030}}}},
    {"nerf is_fisheye",
     R"({"w": 640, "h": 480, "fl_x": 300, "fl_y": 310, "cx": 321, "cy": 241, "is_fisheye": true, "k1": 0.01, "k2": 0.02, "k3": -0.003, "k4": 0.004, "frames": []})",
     {{{350.030140849, 301.528957755}, {225.557272737, 314.080613629}, {419.137753031, 153.135133030}}}},
    {"nerf camera_angle",
     R"({"w": 640, "h": 480, "camera_angle_x": 1.2, "camera_angle_y": 0.9, "frames": []})",
     {{{366.274270306, 338.867553342}, {163.585765645, 363.709441678}, {483.209946073, 90.448669986}}}},
    {"nerf EQUIRECTANGULAR",
     R"({"w": 640, "h": 480, "camera_model": "EQUIRECTANGULAR", "fl_x": 320, "fl_y": 480, "cx": 320, "cy": 240, "frames": []})",
     {{{329.652165578, 269.513972620}, {286.726757648, 275.079636792}, {353.793415501, 197.340351908}}}},
    {"VINS PINHOLE",
     R"(%YAML:1.0
---
model_type: PINHOLE
camera_name: camera
image_width: 640
image_height: 480
distortion_parameters:
   k1: -0.05
   k2: 0.02
   p1: 0.001
   p2: -0.002
projection_parameters:
   fx: 461
   fy: 459
   cx: 330
   cy: 240
)",
     {{{375.940955000, 331.598040000}, {177.132820923, 354.113141927}, {489.262750469, 104.011639688}}}},
    {"VINS PINHOLE_FULL",
     R"(%YAML:1.0
---
model_type: PINHOLE_FULL
camera_name: camera
image_width: 640
image_height: 480
distortion_parameters: {k1: -0.05, k2: 0.02, k3: 0.003, k4: 0.01, k5: -0.004, k6: 0.005, p1: 0.001, p2: -0.002}
projection_parameters: {fx: 461, fy: 459, cx: 330, cy: 240}
)",
     {{{375.918420944, 331.553167412}, {177.380240968, 353.928381948}, {488.949678035, 104.278823289}}}},
    {"VINS MEI",
     R"(%YAML:1.0
---
model_type: MEI
camera_name: camera
image_width: 640
image_height: 480
mirror_parameters:
   xi: 1.8
distortion_parameters:
   k1: -0.05
   k2: 0.02
   p1: 0.001
   p2: -0.002
projection_parameters:
   gamma1: 1339
   gamma2: 1340
   u0: 307
   v0: 237
)",
     {{{354.043049097, 331.197768667}, {155.702825748, 350.544258975}, {463.801908748, 102.475117119}}}},
    {"VINS KANNALA_BRANDT",
     R"(%YAML:1.0
---
model_type: KANNALA_BRANDT
camera_name: camera
image_width: 640
image_height: 480
projection_parameters:
   k2: 0.01
   k3: 0.02
   k4: -0.003
   k5: 0.004
   mu: 300
   mv: 310
   u0: 321
   v0: 241
)",
     {{{350.530140849, 302.028957755}, {226.057272737, 314.580613629}, {419.637753031, 153.635133030}}}},
    {"Kalibr pinhole-radtan",
     R"(cam0:
  camera_model: pinhole
  intrinsics: [461, 459, 330, 240]
  distortion_model: radtan
  distortion_coeffs: [-0.05, 0.02, 0.001, -0.002]
  resolution: [640, 480]
)",
     {{{375.940955000, 331.598040000}, {177.132820923, 354.113141927}, {489.262750469, 104.011639688}}}},
    {"Kalibr pinhole-equi",
     R"(cam0:
  camera_model: pinhole
  intrinsics: [300, 310, 321, 241]
  distortion_model: equidistant
  distortion_coeffs: [0.01, 0.02, -0.003, 0.004]
  resolution: [640, 480]
)",
     {{{350.530140849, 302.028957755}, {226.057272737, 314.580613629}, {419.637753031, 153.635133030}}}},
    {"Kalibr pinhole-fov",
     R"(cam0:
  camera_model: pinhole
  intrinsics: [300, 310, 321, 241]
  distortion_model: fov
  distortion_coeffs: [0.9]
  resolution: [640, 480]
)",
     {{{352.716282319, 306.546983459}, {218.946885441, 320.091163783}, {427.038849540, 147.079876121}}}},
    {"Kalibr omni-radtan",
     R"(cam0:
  camera_model: omni
  intrinsics: [1.8, 1339, 1340, 307, 237]
  distortion_model: radtan
  distortion_coeffs: [-0.05, 0.02, 0.001, -0.002]
  resolution: [640, 480]
)",
     {{{354.043049097, 331.197768667}, {155.702825748, 350.544258975}, {463.801908748, 102.475117119}}}},
    {"Kalibr eucm",
     R"(cam0:
  camera_model: eucm
  intrinsics: [0.6, 1.1, 300, 310, 321, 241]
  distortion_model: none
  distortion_coeffs: []
  resolution: [640, 480]
)",
     {{{350.519448252, 302.006859720}, {226.194402722, 314.474337891}, {419.457887237, 153.794442733}}}},
    {"Kalibr ds",
     R"(cam0:
  camera_model: ds
  intrinsics: [-0.2, 0.6, 300, 310, 321, 241]
  distortion_model: none
  distortion_coeffs: []
  resolution: [640, 480]
)",
     {{{357.874586393, 317.207478546}, {202.752885692, 332.641513589}, {443.747725386, 132.280586087}}}},
    {"OpenCV five",
     R"(image_width: 640
image_height: 480
camera_matrix: [461, 0, 330, 0, 459, 240, 0, 0, 1]
distortion_coefficients: [-0.05, 0.02, 0.001, -0.002, 0.003]
)",
     {{{375.940972288, 331.598074425}, {177.130408611, 354.114943312}, {489.267395269, 104.007675703}}}},
    {"OpenCV twelve",
     R"(image_width: 640
image_height: 480
camera_matrix: [461, 0, 330, 0, 459, 240, 0, 0, 1]
distortion_coefficients: [-0.05, 0.02, 0.001, -0.002, 0.003, 0.01, -0.004, 0.005, 0.0006, -0.0007, 0.0008, 0.0009]
)",
     {{{375.931444194, 331.572560162}, {177.418535359, 354.004583120}, {488.993883613, 104.375507336}}}},
    {"OpenCV fisheye",
     R"(image_width: 640
image_height: 480
camera_matrix: [461, 0, 330, 0, 459, 240, 0, 0, 1]
distortion_coefficients: [0.01, 0.02, -0.003, 0.004]
fisheye_model: 1
)",
     {{{375.377983105, 330.362230998}, {184.104675772, 348.946779535}, {481.573347158, 110.643632453}}}},
    {"OpenCV omnidir",
     R"(image_width: 640
image_height: 480
camera_matrix: [461, 0, 330, 0, 459, 240, 0, 0, 1]
distortion_coefficients: [-0.05, 0.02, 0.001, -0.002]
xi: !!opencv-matrix
  rows: 1
  cols: 1
  dt: d
  data: [1.3]
)",
     {{{349.750031549, 279.349794994}, {266.211952494, 287.626612800}, {396.153589764, 183.531139103}}}},
    {"ROS plumb_bob",
     R"(image_width: 640
image_height: 480
camera_name: c
camera_matrix:
  rows: 3
  cols: 3
  data: [461, 0, 330, 0, 459, 240, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.05, 0.02, 0.001, -0.002, 0.003]
)",
     {{{375.940972288, 331.598074425}, {177.130408611, 354.114943312}, {489.267395269, 104.007675703}}}},
    {"ROS rational_polynomial",
     R"(image_width: 640
image_height: 480
camera_name: c
camera_matrix:
  rows: 3
  cols: 3
  data: [461, 0, 330, 0, 459, 240, 0, 0, 1]
distortion_model: rational_polynomial
distortion_coefficients:
  rows: 1
  cols: 8
  data: [-0.05, 0.02, 0.001, -0.002, 0.003, 0.01, -0.004, 0.005]
)",
     {{{375.918420944, 331.553167412}, {177.380240968, 353.928381948}, {488.949678035, 104.278823289}}}},
    {"ROS equidistant",
     R"(image_width: 640
image_height: 480
camera_name: c
camera_matrix:
  rows: 3
  cols: 3
  data: [461, 0, 330, 0, 459, 240, 0, 0, 1]
distortion_model: equidistant
distortion_coefficients:
  rows: 1
  cols: 4
  data: [0.01, 0.02, -0.003, 0.004]
)",
     {{{375.377983105, 330.362230998}, {184.104675772, 348.946779535}, {481.573347158, 110.643632453}}}},
    {"ROS roi and binning",
     R"(image_width: 640
image_height: 480
camera_name: c
camera_matrix:
  rows: 3
  cols: 3
  data: [461, 0, 330, 0, 459, 240, 0, 0, 1]
distortion_model: plumb_bob
distortion_coefficients:
  rows: 1
  cols: 5
  data: [-0.05, 0.02, 0.001, -0.002, 0.003]
binning_x: 2
binning_y: 3
roi:
  x_offset: 40
  y_offset: 30
  height: 420
  width: 560
  do_rectify: false
)",
     {{{167.720486144, 100.199358142}, {68.315204306, 107.704981104}, {224.383697634, 24.335891901}}}},
    {"ORB-SLAM3 PinHole",
     R"(%YAML:1.0
Camera.type: "PinHole"
Camera1.fx: 461
Camera1.fy: 459
Camera1.cx: 330
Camera1.cy: 240
Camera1.k1: -0.05
Camera1.k2: 0.02
Camera1.p1: 0.001
Camera1.p2: -0.002
Camera1.k3: 0.003
Camera.width: 640
Camera.height: 480
)",
     {{{375.940972288, 331.598074425}, {177.130408611, 354.114943312}, {489.267395269, 104.007675703}}}},
    {"ORB-SLAM3 KannalaBrandt8",
     R"(%YAML:1.0
Camera.type: "KannalaBrandt8"
Camera1.fx: 300
Camera1.fy: 310
Camera1.cx: 321
Camera1.cy: 241
Camera1.k1: 0.01
Camera1.k2: 0.02
Camera1.k3: -0.003
Camera1.k4: 0.004
Camera.width: 640
Camera.height: 480
)",
     {{{350.530140849, 302.028957755}, {226.057272737, 314.580613629}, {419.637753031, 153.635133030}}}},
    {"EuRoC",
     R"(sensor_type: camera
resolution: [640, 480]
intrinsics: [461, 459, 330, 240]
distortion_model: radial-tangential
distortion_coefficients: [-0.05, 0.02, 0.001, -0.002]
)",
     {{{375.940955000, 331.598040000}, {177.132820923, 354.113141927}, {489.262750469, 104.011639688}}}},
};

class LensFormulas : public testing::Test {
 protected:
  Calibration read(const std::string& content) const {
    base::write_file(folder_ / "lens.dat", content);
    return read_calibration(folder_ / "lens.dat", "");
  }
  std::string fault(const std::string& content) const {
    return tests::refusal_of([&] { read(content); });
  }
  tests::TemporaryFolder folder_;
};

TEST_F(LensFormulas, EveryModelOfEveryFormatGivesThePixelsOfItsPublishedFormula) {
  constexpr double kTolerance_px = 1e-6;
  for (const Oracle& oracle : kOracles) {
    const Calibration calibration = read(oracle.text);
    for (std::size_t i = 0; i < kPoints.size(); ++i) {
      const auto pixel = calibration.camera.project(kPoints[i]);
      ASSERT_TRUE(pixel) << oracle.name << ", point " << i;
      EXPECT_NEAR(pixel->x(), oracle.pixels[i][0], kTolerance_px) << oracle.name << ", point " << i;
      EXPECT_NEAR(pixel->y(), oracle.pixels[i][1], kTolerance_px) << oracle.name << ", point " << i;
    }
  }
}

TEST_F(LensFormulas, AByteOrderMarkInFrontOfAnyFormatChangesNothing) {
  for (const Oracle& oracle : kOracles) {
    const auto pixel = read("\xEF\xBB\xBF" + oracle.text).camera.project(kPoints[0]);
    ASSERT_TRUE(pixel) << oracle.name;
    EXPECT_NEAR(pixel->x(), oracle.pixels[0][0], 1e-6) << oracle.name;
  }
}

TEST_F(LensFormulas, TheImageOfARegionWithJoinedPixelsHasTheSizeOfCameraInfo) {
  const Calibration calibration = read(
      "image_width: 640\nimage_height: 480\ncamera_matrix: [461, 0, 330, 0, 459, 240, 0, 0, 1]\n"
      "distortion_coefficients: [0, 0, 0, 0, 0]\nbinning_x: 2\nbinning_y: 3\n"
      "roi: {x_offset: 40, y_offset: 30, height: 420, width: 560, do_rectify: false}\n");
  EXPECT_EQ(calibration.camera.width(), 280);
  EXPECT_EQ(calibration.camera.height(), 140);
}

TEST_F(LensFormulas, TermsThatNoModelHasAreRefusedByName) {
  struct Case {
    std::string text, fault;
  };
  const std::string nerf = R"({"w": 640, "h": 480, "fl_x": 500, )", opensfm = R"({"c": {"width": 400, "height": 300, )";
  const std::string agisoft =
      "<calibration><width>400</width><height>300</height><f>300</f><projection>frame</projection>";
  const std::vector<Case> cases{
      {"1 THIN_PRISM_FISHEYE 640 480 300 310 321 241 0.01 0.02 0 0 -0.003 0.004 0 0.1",
       "p1, p2, sx1 or sy1 other than 0"},
      {"1 RAD_TAN_THIN_PRISM_FISHEYE 640 480 300 310 321 241 0 0 0 0 0.1 0 0 0 0 0 0 0", "k4, k5, p0, p1 or s0 to s3"},
      {"1 SIMPLE_DIVISION 640 480 300 321 241 -0.1", "SIMPLE_DIVISION is not supported: undistort the images"},
      {nerf + R"("k4": 0.1})", "\"k4\" of the model \"OPENCV\" is not 0"},
      {nerf + R"("camera_model": "OPENCV_FISHEYE", "p2": 0.1})", "\"p2\" of the model \"OPENCV_FISHEYE\" is not 0"},
      {nerf + R"("distortion_params": [0, 0, 0, 0, 0]})", "\"distortion_params\" must be the six numbers"},
      {nerf + R"("is_fisheye": true, "camera_model": "OPENCV"})", "\"is_fisheye\" is true, but camera_model is"},
      {nerf + R"("ftheta_p0": 0.1})", "instant-ngp's lens of \"ftheta_p0\" is not supported"},
      {nerf + R"("frames": [{"cx": 320}, {"cx": 322}]})", "states the lens for each image (\"cx\" in \"frames\")"},
      {opensfm + R"("projection_type": "perspective", "focal": 1, "p1": 0.1}})",
       "projection_type \"perspective\" has no such number"},
      {opensfm + R"("projection_type": "simple_radial", "focal_x": 1, "k2": 0.1}})",
       "projection_type \"simple_radial\" has no such number"},
      {opensfm + R"("projection_type": "fisheye624", "focal_x": 1, "s3": 0.1}})",
       "\"s3\" of the model \"fisheye624\" is not 0"},
      {agisoft + "<k4>0.1</k4></calibration>", "<k4> of the projection \"frame\" is not 0"},
      {agisoft + "<b2>0.1</b2></calibration>", "<b2> of the projection \"frame\" is not 0"},
      {agisoft + "<p3>0.1</p3></calibration>", "<p3> of the projection \"frame\" is not 0"},
      {"<?xml version=\"1.0\"?>\n<document version=\"2.0.0\"><chunk/></document>", "save the lens as Agisoft XML"},
      {"image_width: 640\nimage_height: 480\ncamera_matrix: [461, 0, 330, 0, 459, 240, 0, 0, 1]\nxi: 1.2\n"
       "distortion_coefficients: [0, 0, 0, 0, 0.1]\n",
       "must be k1 k2 p1 p2 beside xi"},
      {"image_width: 640\nimage_height: 480\ncamera_matrix: [461, 0.5, 330, 0, 459, 240, 0, 0, 1]\n"
       "distortion_coefficients: [0, 0, 0, 0, 0]\n",
       "skew is not supported"}};
  for (const Case& one : cases) EXPECT_THAT(fault(one.text), HasSubstr(one.fault)) << one.text;
}

TEST_F(LensFormulas, ALensThatEveryImageStatesAlikeIsThatOfAll) {
  const auto read_width = [&](const std::string& frames) {
    return read(R"({"w": 640, "h": 480, "fl_x": 500, "frames": [)" + frames + "]}").camera.width();
  };
  EXPECT_EQ(read_width(R"({"fl_x": 500, "w": 640}, {"fl_x": 500})"), 640);
}

TEST_F(LensFormulas, AnAngleOfViewThatContradictsTheFocalLengthIsNamed) {
  const auto notes_of = [&](const std::string& angle) {
    return read(R"({"w": 1500, "h": 1000, "fl_x": 2535.75, "camera_angle_x": )" + angle + "}").notes;
  };
  EXPECT_THAT(notes_of("0.86"), testing::ElementsAre(HasSubstr("fl_x is 2535.75 pixels, camera_angle_x gives 1635.3")));
  EXPECT_THAT(notes_of("0.5753"), testing::IsEmpty());
}

TEST_F(LensFormulas, BasaltsTimeOffsetOfTheCamerasIsNamed) {
  const Calibration calibration =
      read(R"({"value0": {"T_imu_cam": [{"px": 0, "py": 0, "pz": 0, "qx": 0, "qy": 0, "qz": 0, "qw": 1}],
              "resolution": [[640, 480]], "cam_time_offset_ns": 2500000, "intrinsics": [{"camera_type": "ds",
              "intrinsics": {"fx": 300, "fy": 310, "cx": 321, "cy": 241, "xi": -0.2, "alpha": 0.6}}]}})");
  EXPECT_THAT(calibration.notes, testing::ElementsAre(HasSubstr("give --imu-time-offset -0.0025")));
}

}  // namespace
}  // namespace tileflight::imaging::lens_formulas_test
