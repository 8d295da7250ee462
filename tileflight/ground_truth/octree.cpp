#include "tileflight/ground_truth/octree.h"

#include <octomap/octomap.h>

#include <algorithm>
#include <sstream>
#include <string>

#include "tileflight/geometry/files.h"
#include "tileflight/geometry/input_error.h"
#include "tileflight/geometry/text_fields.h"

namespace tileflight::ground_truth {
namespace {

/// OctoMap's key of its coordinate zero, and so the number of cells on either side.
constexpr std::int32_t kZeroKey = 32768;

octomap::key_type key_of(std::int32_t index) { return static_cast<octomap::key_type>(kZeroKey + index); }

std::string origin_comment(const geometry::Vec3& origin) {
  std::string text = "# coordinates are relative to the local position";
  for (const double value : origin) {
    text += ' ';
    geometry::append_number(text, value);
  }
  return text + "\n";
}

}  // namespace

void write_octree(const std::filesystem::path& file, const geometry::VoxelGrid& grid) {
  if (*std::max_element(grid.dims.begin(), grid.dims.end()) > kZeroKey) {
    throw InputError(file.string(), "OctoMap holds at most 32768 cells along an axis: choose a larger voxel edge");
  }
  octomap::OcTree tree(grid.edge_m);
  for (const geometry::Cell& c : grid.occupied) {
    const octomap::OcTreeKey key(key_of(c.x), key_of(c.y), key_of(c.z));
    tree.setNodeValue(key, tree.getClampingThresMaxLog(), true);
  }
  tree.updateInnerOccupancy();
  std::ostringstream stream;
  tree.writeBinary(stream);
  std::string bytes = std::move(stream).str();
  // After the first line, which OctoMap checks, comments are welcome.
  bytes.insert(bytes.find('\n') + 1, origin_comment(grid.origin));
  geometry::write_file(file, bytes);
}

}  // namespace tileflight::ground_truth
