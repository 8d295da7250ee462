#include "tileflight/world/ground_truth/octree.h"

#include <octomap/octomap.h>

#include <algorithm>
#include <sstream>
#include <string>

#include "tileflight/core/base/files.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/core/base/text_parsing.h"

namespace tileflight::ground_truth {
namespace {

/// OctoMap's key of coordinate zero, which is also the number of cells on either side of it.
constexpr std::int32_t kZeroKey = 32768;

octomap::key_type key_of(std::int32_t index) { return static_cast<octomap::key_type>(kZeroKey + index); }

/// The text before the data, which OctoMap checks only in its first line. Written here because OctoMap's own writer
/// prints to the console.
std::string header(const octomap::OcTree& tree, const geometry::Vec3& origin) {
  std::string text = "# Octomap OcTree binary file\n# coordinates are relative to the local position";
  for (const double value : origin) {
    text += ' ';
    base::append_number(text, value);
  }
  text += "\nid OcTree\nsize " + std::to_string(tree.size()) + "\nres ";
  base::append_number(text, tree.getResolution());
  return text + "\ndata\n";
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
  tree.prune();
  std::ostringstream stream;
  if (tree.getRoot() != nullptr) tree.writeBinaryNode(stream, tree.getRoot());
  base::write_file(file, header(tree, grid.origin) + std::move(stream).str());
}

}  // namespace tileflight::ground_truth
