#include "tileflight/tiles/mesh_files/mapped_file.h"

#include <fcntl.h>
#include <sys/mman.h>
#include <sys/stat.h>
#include <unistd.h>

#include <cerrno>
#include <string>
#include <system_error>

#include "tileflight/core/base/input_error.h"

namespace tileflight::mesh_files {

MappedFile::MappedFile(const std::filesystem::path& file, std::uintmax_t max_bytes) {
  const int descriptor = ::open(file.c_str(), O_RDONLY | O_CLOEXEC);
  struct stat status {};
  const auto fail = [&](const std::string& what) {
    if (descriptor >= 0) ::close(descriptor);
    return InputError(file.string(), what);
  };
  if (descriptor < 0 || ::fstat(descriptor, &status) != 0)
    throw fail("cannot be opened: " + std::system_category().message(errno));
  if (!S_ISREG(status.st_mode)) throw fail("is not a file");
  if (static_cast<std::uintmax_t>(status.st_size) > max_bytes)
    throw fail("is larger than the limit of " + std::to_string(max_bytes) + " bytes");
  size_ = static_cast<std::size_t>(status.st_size);
  if (size_ > 0) {
    void* const at = ::mmap(nullptr, size_, PROT_READ, MAP_PRIVATE, descriptor, 0);
    if (at == MAP_FAILED) throw fail("cannot be read: " + std::system_category().message(errno));
    data_ = static_cast<char*>(at);
    ::madvise(data_, size_, MADV_SEQUENTIAL);
  }
  ::close(descriptor);
}

MappedFile::~MappedFile() {
  if (data_ != nullptr) ::munmap(data_, size_);
}

void MappedFile::release() const {
  if (data_ != nullptr) ::madvise(data_, size_, MADV_DONTNEED);
}

}  // namespace tileflight::mesh_files
