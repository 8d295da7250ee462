#pragma once

#include <array>
#include <filesystem>
#include <optional>
#include <string>
#include <variant>
#include <vector>

#include "tileflight/core/geometry/transform.h"

namespace tileflight::imaging {

/// Pinhole with Brown-Conrady distortion (Kalibr pinhole-radtan, OpenCV's first four): k1, k2 radial, p1, p2
/// tangential. All zero is the plain pinhole.
struct PinholeRadtan {
  double fx = 0, fy = 0, cx = 0, cy = 0;  ///< pixels; pixel centres at integers
  std::array<double, 4> d{};              ///< k1 k2 p1 p2
};

/// Pinhole with OpenCV's rational and thin-prism distortion, in OpenCV's order: k1 k2 p1 p2 k3 k4 k5 k6 s1 s2 s3 s4
/// (lens_distortion.h). If k4 to s4 are zero, it is Brown-Conrady with a third radial coefficient.
struct PinholeRational {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, 12> d{};
};

/// Kannala-Brandt (Kalibr pinhole-equi, OpenCV fisheye): r = theta + k1 theta^3 + k2 theta^5 + k3 theta^7 + k4 theta^9.
/// Valid beyond 180 degrees, up to where r(theta) stops increasing.
struct KannalaBrandt {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  std::array<double, 4> k{};
};

/// DSO's and PTAM's field-of-view model, w in radians (Devernay and Faugeras 2001).
struct FovModel {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double w = 0;
};

/// Double sphere (Usenko, Demmel, Cremers 2018; Kalibr ds): xi above -1, alpha from 0 to 1. Valid beyond 180 degrees.
struct DoubleSphere {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double xi = 0, alpha = 0;
};

/// Unified model of Mei and Rives 2007 (Kalibr omni): projection onto a unit sphere, then a pinhole `xi` behind its
/// centre, then Brown-Conrady distortion. xi = 0 is the plain pinhole. Covers more than 180 degrees if xi is above 0.
struct UnifiedModel {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double xi = 0;
  std::array<double, 4> d{};  ///< k1 k2 p1 p2
};

/// Extended unified model (Khomutenko, Garcia, Martinet 2016; Kalibr eucm): alpha from 0 to 1, beta above 0.
struct ExtendedUnifiedModel {
  double fx = 0, fy = 0, cx = 0, cy = 0;
  double alpha = 0, beta = 1;
};

/// Equirectangular panorama: u = fx longitude + cx, v = fy latitude + cy, with longitude = atan2(x, z) and latitude =
/// atan2(y, |(x, z)|), radians. A full sphere over W x H pixels has fx = W / (2 pi), fy = H / pi.
struct Equirectangular {
  double fx = 0, fy = 0, cx = 0, cy = 0;
};

using CameraModel = std::variant<PinholeRadtan, KannalaBrandt, FovModel, DoubleSphere, UnifiedModel,
                                 ExtendedUnifiedModel, PinholeRational, Equirectangular>;

/// A lens model and its image size, width x height. Camera frame: x right, y down, z forward.
class Camera {
 public:
  Camera() = default;
  Camera(CameraModel model, int width, int height);

  int width() const { return width_; }
  int height() const { return height_; }
  const CameraModel& model() const { return model_; }

  /// Projects a point (only its direction counts) to a pixel. nullopt outside the model's valid cone; pixels outside
  /// the image are returned unchanged.
  std::optional<geometry::Vec2> project(const geometry::Vec3& point_camera) const;
  /// Projects a point and computes the 2x3 derivative of the pixel by the point; also nullopt at a panorama's poles,
  /// where the derivative is undefined.
  std::optional<geometry::Vec2> project(const geometry::Vec3& point_camera,
                                        Eigen::Matrix<double, 2, 3>& d_pixel_d_point) const;
  /// Whether a pixel position lies on the image, its edge included.
  bool contains(const geometry::Vec2& pixel) const {
    return pixel.x() >= -0.5 && pixel.y() >= -0.5 && pixel.x() <= width_ - 0.5 && pixel.y() <= height_ - 0.5;
  }
  /// Returns the unit ray of a pixel; nullopt outside the model's valid region. project(unproject(p)) == p to 1e-9 px.
  std::optional<geometry::Vec3> unproject(const geometry::Vec2& pixel) const;

  /// Largest valid angle from the optical axis, radians.
  double max_theta_rad() const { return max_theta_rad_; }
  /// Largest angle from the optical axis visible in the image, radians: the maximum along the image border, or
  /// max_theta_rad() if the border lies outside the valid region.
  double max_image_angle_rad() const;
  /// Horizontal field of view along the middle row, degrees.
  double horizontal_fov_deg() const;

  /// Returns the lens for an image of another size and equal aspect ratio (within a pixel). Pixel centres are at
  /// integers: cx' = (cx + 0.5) s - 0.5. Throws InputError if the aspect ratio differs.
  Camera scaled_to(int width, int height) const;

 private:
  CameraModel model_;
  int width_ = 0;
  int height_ = 0;
  double max_theta_rad_ = 0;
};

/// Makes an equidistant-like fisheye (Kannala-Brandt, k as given) whose horizontal field of view over `width` is
/// `fov_deg`.
Camera make_fisheye(int width, int height, double fov_deg, std::array<double, 4> k = {});
Camera make_pinhole(int width, int height, double fov_deg);
/// Makes a panorama of the full sphere.
Camera make_panorama(int width, int height);

/// Content of a calibration file: the lens and further parameters.
struct Calibration {
  Camera camera;
  geometry::SE3 T_cam_imu;    ///< identity if the file has none
  double line_delay_s = 0.0;  ///< rolling shutter: time from one row to the next; 0: global shutter
  /// Whether the file does not state T_cam_imu, so that the identity is an assumption; write_kalibr() leaves it out.
  bool assumes_T_cam_imu = false;
  std::vector<std::string> notes{};  ///< what the file states and is not used, and what is assumed; a sentence each
};

/// Reads a Kalibr camchain YAML (cam0; pinhole + radtan | equidistant | fov | none; omni + radtan | none; ds; eucm),
/// and in the same format two models that Kalibr lacks: pinhole + rational (5, 8 or 12 numbers, OpenCV's order),
/// equirectangular. Throws InputError (file, key, cause): unknown models, NaN, wrong counts, resolution <= 0.
Calibration read_kalibr(const std::filesystem::path& file);
void write_kalibr(const std::filesystem::path& file, const Calibration& calibration);

/// Reads DSO's four-line camera.txt (Pinhole, FOV, RadTan, EquiDistant, KannalaBrandt; relative or absolute numbers).
Calibration read_dso_camera(const std::filesystem::path& file);
/// Whether DSO's format supports the lens model.
bool has_dso_model(const Camera& camera);
/// Writes DSO's camera.txt. Throws InputError for a lens model that the format does not support.
void write_dso_camera(const std::filesystem::path& file, const Calibration& calibration);

/// Detects the format from the content (calibration_files.h) and reads the only camera of the file. Throws InputError.
Calibration read_calibration(const std::filesystem::path& file);

}  // namespace tileflight::imaging
