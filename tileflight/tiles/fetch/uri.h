#pragma once

#include <cstddef>
#include <string>
#include <string_view>
#include <vector>

namespace tileflight::fetch {

/// Resolves `reference`, found in the file `base`, to a URI of the same source, as browsers do (WHATWG URL): blanks
/// around it are dropped, backslashes count as slashes, "%2e" as a point. An http(s) URL is percent-encoded, its host
/// in lower case and without the default port. A relative base gives a relative URI, which stays as it is written; its
/// leading ".." segments are kept, so that a source can detect that it leaves the root. Fragments are dropped.
std::string resolve_uri(std::string_view base, std::string_view reference);

/// Resolves like `resolve_uri`, and adds those query parameters of `base` that the reference lacks if both are http(s)
/// URLs of one origin, as CesiumJS and cesium-native do: a server may require its session in every request. Parameters
/// that name a version of one object (S3, Azure, Google Cloud Storage) are not passed on.
std::string resolve_in_tileset(std::string_view base, std::string_view reference);

/// Returns the scheme in lower case: "https" for "https://host/a". Empty if the URI is relative or a path.
std::string uri_scheme(std::string_view uri);

/// Returns the path of a relative URI without query and fragment, percent-decoded. A percent sign without two
/// hexadecimal digits stands for itself. Throws InputError for a zero byte.
std::string uri_path(std::string_view uri);

/// Returns the lower-case extension of the last segment: "b3dm" for "a/b.B3DM?v=1". Empty if there is none.
std::string uri_extension(std::string_view uri);

/// Returns whether a URI begins with "data:".
bool is_data_uri(std::string_view uri);
/// Decodes a "data:" URI, base64 or percent-encoded (RFC 2397). Throws InputError.
std::vector<std::byte> decode_data_uri(std::string_view uri, const std::string& name);

/// Returns a URI for messages: keys and tokens are hidden (url_secrets.h); a "data:" URI or a very long one is
/// shortened.
std::string uri_for_message(std::string_view uri);

}  // namespace tileflight::fetch
