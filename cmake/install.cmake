# Filled in by the install rules: headers, library, harcoConfig.cmake, harco.pc.
