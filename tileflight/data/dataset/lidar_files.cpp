#include "tileflight/data/dataset/lidar_files.h"

#include <array>
#include <bit>
#include <cstring>
#include <string>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/raw_bytes.h"
#include "tileflight/core/geometry/cloud_files.h"

namespace tileflight::dataset {

namespace {

static_assert(std::endian::native == std::endian::little);

void append_position(std::string& bytes, const ScanPoint& point) {
  for (int axis = 0; axis < 3; ++axis) base::append_raw(bytes, point.position[axis]);
  base::append_raw(bytes, point.intensity);
}

std::vector<ScanPoint> read_ply(const std::filesystem::path& file) {
  const geometry::PointCloud cloud = geometry::read_cloud(file);
  const auto scalar = [&cloud](const char* name, std::size_t i) {
    const auto found = cloud.scalars.find(name);
    return found == cloud.scalars.end() ? 0.0F : found->second[i];
  };
  std::vector<ScanPoint> points(cloud.size());
  for (std::size_t i = 0; i < points.size(); ++i) {
    points[i] = {cloud.positions[i].cast<float>(), scalar("intensity", i), scalar("time", i),
                 static_cast<std::uint16_t>(scalar("ring", i))};
  }
  return points;
}

std::vector<ScanPoint> read_bin(const std::filesystem::path& file) {
  const std::vector<std::byte> bytes = base::read_bytes(file);
  constexpr std::size_t kPointBytes = 4 * sizeof(float);
  if (bytes.size() % kPointBytes != 0)
    throw InputError(file.string(), "its size is not a multiple of four floats (x, y, z, intensity)");
  std::vector<ScanPoint> points(bytes.size() / kPointBytes);
  for (std::size_t i = 0; i < points.size(); ++i) {
    std::array<float, 4> v{};
    std::memcpy(v.data(), bytes.data() + i * kPointBytes, kPointBytes);
    points[i].position = {v[0], v[1], v[2]};
    points[i].intensity = v[3];
  }
  return points;
}

}  // namespace

void write_scan_ply(const std::filesystem::path& file, const std::vector<ScanPoint>& points) {
  std::string bytes = "ply\nformat binary_little_endian 1.0\nelement vertex " + std::to_string(points.size()) +
                      "\nproperty float x\nproperty float y\nproperty float z\nproperty float intensity\n"
                      "property float time\nproperty ushort ring\nend_header\n";
  for (const ScanPoint& point : points) {
    append_position(bytes, point);
    base::append_raw(bytes, point.time_s);
    base::append_raw(bytes, point.ring);
  }
  base::write_file(file, bytes);
}

void write_scan_bin(const std::filesystem::path& file, const std::vector<ScanPoint>& points) {
  std::string bytes;
  for (const ScanPoint& point : points) append_position(bytes, point);
  base::write_file(file, bytes);
}

std::vector<ScanPoint> read_scan(const std::filesystem::path& file) {
  if (file.extension() == ".ply") return read_ply(file);
  if (file.extension() == ".bin") return read_bin(file);
  throw InputError(file.string(), "unknown lidar scan format (.ply or .bin expected)");
}

}  // namespace tileflight::dataset
