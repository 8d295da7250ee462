#include <string_view>

#include "tests/fuzz/memory_file.h"
#include "tileflight/core/base/input_error.h"
#include "tileflight/tiles/mesh_files/obj_meshes.h"
#include "tileflight/tiles/mesh_files/ply_meshes.h"

/// A mesh of any bytes: PLY, or OBJ and its MTL.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    if (text.starts_with("ply")) {
      mesh_files::read_ply_meshes(fuzz::MemoryFile(data, size).path(), false);
    } else if (text.find("newmtl") != std::string_view::npos) {
      mesh_files::parse_mtl(text, "input");
    } else {
      mesh_files::parse_obj(text, "input");
    }
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}
