#include <string_view>

#include "tests/fuzz/memory_file.h"
#include "tileflight/base/input_error.h"
#include "tileflight/tiling/mtl_file.h"
#include "tileflight/tiling/obj_file.h"
#include "tileflight/tiling/ply_meshes.h"

/// A mesh of any bytes: PLY, or OBJ and its MTL.
extern "C" int LLVMFuzzerTestOneInput(const std::uint8_t* data, std::size_t size) {
  using namespace tileflight;
  const std::string_view text(reinterpret_cast<const char*>(data), size);
  try {
    if (text.starts_with("ply")) {
      tiling::read_ply_meshes(fuzz::MemoryFile(data, size).path(), false);
    } else if (text.find("newmtl") != std::string_view::npos) {
      tiling::parse_mtl(text, "input");
    } else {
      tiling::parse_obj(text, "input");
    }
  } catch (const InputError&) {
    // one clear line is what broken input is worth
  }
  return 0;
}
