#include "tileflight/core/base/hash.h"

#include <openssl/evp.h>

#include <array>
#include <stdexcept>

#include "tileflight/core/base/files.h"

namespace tileflight::base {

std::array<std::uint8_t, 16> md5(std::string_view bytes) {
  std::array<std::uint8_t, 16> digest{};
  if (EVP_Digest(bytes.data(), bytes.size(), digest.data(), nullptr, EVP_md5(), nullptr) != 1)
    throw std::runtime_error("OpenSSL's MD5 failed");
  return digest;
}

namespace {

/// These calls fail only if memory is exhausted or the library lacks SHA-256.
void require(bool done) {
  if (!done) throw std::runtime_error("OpenSSL's SHA-256 failed");
}

}  // namespace

struct Sha256::Context {
  std::unique_ptr<EVP_MD_CTX, decltype(&EVP_MD_CTX_free)> evp{EVP_MD_CTX_new(), &EVP_MD_CTX_free};
};

Sha256::Sha256() : context_(std::make_unique<Context>()) {
  require(context_->evp && EVP_DigestInit_ex(context_->evp.get(), EVP_sha256(), nullptr) == 1);
}

Sha256::~Sha256() = default;

void Sha256::add(std::string_view bytes) {
  require(EVP_DigestUpdate(context_->evp.get(), bytes.data(), bytes.size()) == 1);
}

std::string Sha256::hex() const {
  const Context copy;  // finishing closes a context, but more may be added to this object
  std::array<unsigned char, EVP_MAX_MD_SIZE> digest{};
  unsigned size = 0;
  require(copy.evp && EVP_MD_CTX_copy_ex(copy.evp.get(), context_->evp.get()) == 1 &&
          EVP_DigestFinal_ex(copy.evp.get(), digest.data(), &size) == 1);
  std::string text;
  for (unsigned i = 0; i < size; ++i) {
    constexpr const char* kDigits = "0123456789abcdef";
    text += kDigits[digest[i] >> 4];
    text += kDigits[digest[i] & 15];
  }
  return text;
}

std::string sha256_hex(std::string_view bytes) {
  Sha256 hash;
  hash.add(bytes);
  return hash.hex();
}

std::uint16_t crc16_mcrf4xx(std::string_view bytes, std::uint16_t crc) {
  constexpr unsigned kPolynomial = 0x8408;  // x^16 + x^12 + x^5 + 1, lowest bit first
  unsigned sum = crc;
  for (const char c : bytes) {
    sum ^= static_cast<unsigned char>(c);
    for (int bit = 0; bit < 8; ++bit) sum = (sum & 1U) != 0 ? sum >> 1U ^ kPolynomial : sum >> 1U;
  }
  return static_cast<std::uint16_t>(sum);
}

}  // namespace tileflight::base
