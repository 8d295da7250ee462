#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>

#include "tileflight/geometry/transform.h"

namespace tileflight::imaging {

/// Pinhole with Brown-Conrady distortion (Kalibr pinhole-radtan, OpenCV's first four): k1, k2 radial, p1, p2
/// tangential. All zero is the plain pinhole.
struct PinholeRadtan {
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels; pixel centres at integers
  std::array<double, 4> d{};              ///< k1 k2 p1 p2
};

/// Pinhole with OpenCV's rational and thin-prism distortion, in its order: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4
/// (rational_distortion.h). k4 to s4 of zero are Brown-Conrady with a third radial coefficient.
struct PinholeRational {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, 12> d{};
};

/// Kannala-Brandt (Kalibr pinhole-equi, OpenCV fisheye): r = theta + k1 theta^3 + k2 theta^5 + k3 theta^7 + k4 theta^9.
/// Valid beyond 180 degrees, up to where r(theta) stops growing.
struct KannalaBrandt {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, 4> k{};
};

/// DSO's and PTAM's field-of-view model, w in radians (Devernay and Faugeras 2001).
struct FovModel {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double w = 0;
};

/// Double sphere (Usenko, Demmel, Cremers 2018; Kalibr ds): xi above -1, alpha from 0 to 1. Holds beyond 180 degrees.
struct DoubleSphere {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double xi = 0, alpha = 0;
};

/// Unified model of Mei and Rives 2007 (Kalibr omni): a sphere, a pinhole `xi` behind its centre, then Brown-Conrady
/// distortion. xi = 0 is the pinhole. Beyond 180 degrees with xi above 0.
struct Unified {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double xi = 0;
  std::array<double, 4> d{};  ///< k1 k2 p1 p2
};

/// Extended unified model (Khomutenko, Garcia, Martinet 2016; Kalibr eucm): alpha from 0 to 1, beta above 0.
struct ExtendedUnified {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double alpha = 0, beta = 1;
};

/// Panorama: u = fx longitude + cx, v = fy latitude + cy, with longitude = atan2(x, z) and latitude = atan2(y,
/// |(x, z)|), radians. A whole sphere over W x H pixels has fx = W / (2 pi), fy = H / pi.
struct Equirectangular {
  double fx = 0, fy = 0, cx = 0, cy = 0;
};

using CameraModel = std::variant<PinholeRadtan, KannalaBrandt, FovModel, DoubleSphere, Unified, ExtendedUnified,
                                 PinholeRational, Equirectangular>;

/// A lens over an image of width x height. Camera frame: x right, y down, z forward.
class Camera {
 public:
  Camera() = default;
  Camera(CameraModel model, int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }
  const CameraModel& model() const { return model_; }

  /// Pixel of a point (any length; only its direction counts). nullopt outside the model's valid cone; pixels outside
  /// the image are returned as they are.
  std::optional<geometry::Vec2> project(const geometry::Vec3& point_camera) const;
  /// As project, with the 2x3 derivative of the pixel by the point; nullopt also at a panorama's poles, where there is
  /// none.
  std::optional<geometry::Vec2> project(const geometry::Vec3& point_camera,
                                        Eigen::Matrix<double, 2, 3>& d_pixel_d_point) const;
  /// Unit ray of a pixel; nullopt outside the model's valid region. project(unproject(p)) == p to 1e-9 px.
  std::optional<geometry::Vec3> unproject(const geometry::Vec2& pixel) const;

  /// Largest angle from the optical axis for which the model holds, radians.
  double max_theta_rad() const { return max_theta_rad_; }
  /// Largest angle from the optical axis that the image shows, radians: found along its border, and max_theta_rad()
  /// where that lies outside of the valid region.
  double widest_angle_rad() const;
  /// Full horizontal angle seen along the middle row, degrees.
  double horizontal_fov_deg() const;

  /// The same lens over an image of another size with the same aspect ratio (within a pixel). Pixel centres at
  /// integers: cx' = (cx + 0.5) s - 0.5. Throws InputError when the aspect ratio differs.
  Camera scaled_to(int width, int height) const;

 private:
  CameraModel model_;
  int width_ = 0;
  int height_ = 0;
  double max_theta_rad_ = 0;
};

/// Equidistant-like fisheye (Kannala-Brandt, k as given) whose horizontal field of view over `width` is `fov_deg`.
Camera make_fisheye(int width, int height, double fov_deg, std::array<double, 4> k = {});
Camera make_pinhole(int width, int height, double fov_deg);
/// The whole sphere.
Camera make_panorama(int width, int height);

/// A calibration file: the lens, and what the file says beside it.
struct Calibration {
  Camera camera;
  geometry::SE3 T_cam_imu;    ///< identity where the file has none
  double line_delay_s = 0.0;  ///< rolling shutter: time from one row to the next; 0 is a global shutter
};

/// Kalibr camchain YAML (cam0; pinhole + radtan | equidistant | fov | none; omni + radtan | none; ds; eucm), and in the
/// same form what Kalibr has no name for: pinhole + rational (5, 8 or 12 numbers, OpenCV's order), equirectangular.
/// Throws InputError (file, key, cause): unknown models, NaN, wrong counts, resolution <= 0.
Calibration read_kalibr(const std::filesystem::path& file);
void write_kalibr(const std::filesystem::path& file, const Calibration& calibration);

/// DSO's four-line camera.txt (Pinhole, FOV, RadTan, EquiDistant, KannalaBrandt; relative or absolute numbers).
Calibration read_dso_camera(const std::filesystem::path& file);
/// Whether DSO's format has a name for the lens.
bool has_dso_name(const Camera& camera);
/// Throws InputError for a lens without a name there.
void write_dso_camera(const std::filesystem::path& file, const Calibration& calibration);

/// By its content: Kalibr, OpenCV, COLMAP or DSO (calibration_files.h). Throws InputError.
Calibration read_calibration(const std::filesystem::path& file);

}  // namespace tileflight::imaging
