#include "tileflight/core/base/md5.h"

#include <openssl/evp.h>

#include <stdexcept>

namespace tileflight::base {

std::array<std::uint8_t, 16> md5(std::string_view bytes) {
  std::array<std::uint8_t, 16> digest{};
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), nullptr, EVP_md5(), nullptr) != 1)
    throw std::runtime_error("OpenSSL's MD5 failed");
  return digest;
}

}  // namespace tileflight::base
