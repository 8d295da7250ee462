#pragma once

#include <array>
#include <cmath>
#include <cstdint>
#include <cstring>
#include <filesystem>
#include <fstream>
#include <nlohmann/json.hpp>
#include <string>
#include <vector>

namespace tileflight::tests {

/// A place made by hand, independent of the program's own writer: a hilly 80 m x 80 m square in a local z-up frame,
/// coloured by vertex, as 3D Tiles 1.1: root.glb (coarse, error 4) refined by the quarters 0.glb to 3.glb (error 0).
class TinyPlace {
 public:
  static constexpr double kHalf = 40.0;  ///< metres; x and y from -40 to 40

  /// A camera for flights over it: 120 degrees across 320 x 240 pixels.
  static constexpr const char* kCamera = R"(cam0:
  camera_model: pinhole
  intrinsics: [152.0, 152.0, 159.5, 119.5]
  distortion_model: equidistant
  distortion_coeffs: [0.0, 0.0, 0.0, 0.0]
  resolution: [320, 240]
)";

  /// Returns the camera with the same view in a quarter of the pixels.
  static std::string camera_of_quarter_size() {
    std::string camera = kCamera;
    for (const auto& [from, to] :
         {std::array{"152.0, 152.0, 159.5, 119.5", "76.0, 76.0, 79.5, 59.5"}, std::array{"[320, 240]", "[160, 120]"}})
      camera.replace(camera.find(from), std::strlen(from), to);
    return camera;
  }

  /// A short flight over the place with an IMU and a lidar, for `camera` or `cameras` before it.
  static std::string path_with_sensors(int frames) {
    return "max_frames: " + std::to_string(frames) + R"(
fps: 8
speed_m_s: 8
waypoints:
  - {position: [-10, -18, 112], yaw_deg: 20, pitch_deg: -30}
  - {position: [10, -15, 113], yaw_deg: 30, pitch_deg: -35}
sensors:
  imu: {rate_hz: 50}
  lidar: {pattern: raster, columns: 20, rows: 10, horizontal_fov_deg: 60, vertical_fov_deg: 40, rate_hz: 8}
)";
  }

  static double height(double x, double y) { return 100.0 + 3.0 * std::sin(x / 7.0) * std::cos(y / 9.0); }

  /// Writes tileset.json and its five tiles into `folder`.
  static void write(const std::filesystem::path& folder) {
    std::filesystem::create_directories(folder);
    write_file(folder / "tileset.json", tileset().dump(1));
    write_file(folder / "root.glb", glb(-kHalf, -kHalf, 2 * kHalf, 10));
    for (int i = 0; i < 4; ++i) {
      write_file(folder / (std::to_string(i) + ".glb"),
                 glb(i % 2 == 0 ? -kHalf : 0.0, i / 2 == 0 ? -kHalf : 0.0, kHalf, 40));
    }
  }

  static nlohmann::json tileset() {
    nlohmann::json children = nlohmann::json::array();
    for (int i = 0; i < 4; ++i) {
      const double x = i % 2 == 0 ? -kHalf / 2 : kHalf / 2;
      const double y = i / 2 == 0 ? -kHalf / 2 : kHalf / 2;
      children.push_back({{"boundingVolume", {{"box", box(x, y, kHalf / 2)}}},
                          {"geometricError", 0},
                          {"content", {{"uri", std::to_string(i) + ".glb"}}}});
    }
    return {{"asset", {{"version", "1.1"}, {"copyright", "Tiny Place, CC0"}}},
            {"geometricError", 16},
            {"root",
             {{"boundingVolume", {{"box", box(0, 0, kHalf)}}},
              {"geometricError", 4},
              {"refine", "REPLACE"},
              {"content", {{"uri", "root.glb"}}},
              {"children", children}}}};
  }

  /// A tile of the format pnts (3D Tiles 1.0) with one point in the middle of the place.
  static std::string one_point_pnts() {
    std::string feature_table = R"({"POINTS_LENGTH":1,"POSITION":{"byteOffset":0}})";
    while (feature_table.size() % 8 != 4) feature_table += ' ';  // the header has 28 bytes
    std::string tile = "pnts";
    append(tile, std::vector<std::uint32_t>{1, static_cast<std::uint32_t>(28 + feature_table.size() + 12),
                                            static_cast<std::uint32_t>(feature_table.size()), 12, 0, 0});
    tile += feature_table;
    append(tile, std::vector<float>{0.0F, 0.0F, 100.0F});
    return tile;
  }

  /// A grid of n x n squares from (x0, y0), `size` metres wide; glTF is y-up, so (x, y, z) is stored as (x, z, -y).
  static std::string glb(double x0, double y0, double size, std::uint32_t n) {
    std::vector<float> positions;
    std::vector<std::uint8_t> colors;
    std::vector<std::uint32_t> indices;
    for (std::uint32_t j = 0; j <= n; ++j) {
      for (std::uint32_t i = 0; i <= n; ++i) {
        const double x = x0 + size * i / n;
        const double y = y0 + size * j / n;
        for (const double v : {x, height(x, y), -y}) positions.push_back(static_cast<float>(v));
        const auto shade = static_cast<std::uint8_t>(40 + (i * 2654435761U ^ j * 40503U) % 180);
        for (const std::uint8_t c :
             {shade, static_cast<std::uint8_t>(255 - shade), std::uint8_t{90}, std::uint8_t{255}})
          colors.push_back(c);
        if (i == n || j == n) continue;
        const std::uint32_t a = j * (n + 1) + i;
        for (const std::uint32_t k : {a, a + 1, a + n + 2, a, a + n + 2, a + n + 1}) indices.push_back(k);
      }
    }
    std::string binary;
    append(binary, positions);
    append(binary, colors);
    append(binary, indices);
    const nlohmann::json gltf = document(positions, colors.size(), indices.size());
    std::string chunks;
    append_chunk(chunks, "JSON", gltf.dump(), ' ');
    append_chunk(chunks, std::string("BIN\0", 4), binary, '\0');
    std::string bytes = "glTF";
    append(bytes, std::vector<std::uint32_t>{2, static_cast<std::uint32_t>(12 + chunks.size())});
    return bytes + chunks;
  }

  static void write_file(const std::filesystem::path& file, const std::string& bytes) {
    std::ofstream(file, std::ios::binary) << bytes;
  }

 private:
  static nlohmann::json box(double x, double y, double half) { return {x, y, 100, half, 0, 0, 0, half, 0, 0, 0, 4}; }

  template <class T>
  static void append(std::string& bytes, const std::vector<T>& values) {
    bytes.append(reinterpret_cast<const char*>(values.data()), values.size() * sizeof(T));
  }

  static void append_chunk(std::string& bytes, const std::string& kind, std::string content, char padding) {
    while (content.size() % 4 != 0) content += padding;
    append(bytes, std::vector<std::uint32_t>{static_cast<std::uint32_t>(content.size())});
    bytes += kind + content;
  }

  static nlohmann::json document(const std::vector<float>& positions, std::size_t color_bytes,
                                 std::size_t index_count) {
    const std::size_t position_bytes = positions.size() * 4;
    const std::size_t count = positions.size() / 3;
    std::array<float, 3> low{1e9F, 1e9F, 1e9F};
    std::array<float, 3> high{-1e9F, -1e9F, -1e9F};
    for (std::size_t i = 0; i < positions.size(); ++i) {
      low[i % 3] = std::min(low[i % 3], positions[i]);
      high[i % 3] = std::max(high[i % 3], positions[i]);
    }
    return {
        {"asset", {{"version", "2.0"}}},
        {"scene", 0},
        {"scenes", {{{"nodes", {0}}}}},
        {"nodes", {{{"mesh", 0}}}},
        {"meshes", {{{"primitives", {{{"attributes", {{"POSITION", 0}, {"COLOR_0", 1}}}, {"indices", 2}}}}}}},
        {"buffers", {{{"byteLength", position_bytes + color_bytes + index_count * 4}}}},
        {"bufferViews",
         {{{"buffer", 0}, {"byteOffset", 0}, {"byteLength", position_bytes}},
          {{"buffer", 0}, {"byteOffset", position_bytes}, {"byteLength", color_bytes}},
          {{"buffer", 0}, {"byteOffset", position_bytes + color_bytes}, {"byteLength", index_count * 4}}}},
        {"accessors",
         {{{"bufferView", 0}, {"componentType", 5126}, {"count", count}, {"type", "VEC3"}, {"min", low}, {"max", high}},
          {{"bufferView", 1}, {"componentType", 5121}, {"normalized", true}, {"count", count}, {"type", "VEC4"}},
          {{"bufferView", 2}, {"componentType", 5125}, {"count", index_count}, {"type", "SCALAR"}}}}};
  }
};

}  // namespace tileflight::tests
