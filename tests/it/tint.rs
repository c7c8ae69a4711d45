//! Shaders compile in Tint, the WGSL compiler of Chromium, from the text that a page for browsers holds.

use crate::browser::{WebGpu, answers};
use crate::shaders::tried;
use rayon::prelude::*;
use std::collections::{BTreeSet, HashMap};
use umbravox::gpu::{compose, write_wgsl};

/// Largest number of shaders that one page compiles: the browser keeps all of them in memory.
const MOST_SHADERS: usize = 500;

/// Page that compiles the files `0`, `1`, ... and posts what the compiler says of each that fails.
const PAGE: &str = r#"<!DOCTYPE html><title>shaders</title><script>
(async () => {
  const post = (path, body) => fetch(path, { method: "POST", body });
  try {
    const adapter = await navigator.gpu.requestAdapter();
    const device = await adapter.requestDevice();
    for (let i = 0; i < COUNT; i++) {
      const code = await (await fetch(`/${i}`)).text();
      device.pushErrorScope("validation");
      const module = device.createShaderModule({ code });
      const { messages } = await module.getCompilationInfo();
      const error = await device.popErrorScope();
      const said = messages.map(({ type, lineNum, message }) => `${type} in line ${lineNum}: ${message}`);
      if (error || said.length) await post(`/${i}`, `${error?.message ?? ""} ${said.join("; ")}`);
    }
    await post("/end", "");
  } catch (error) {
    await post("/error", error.stack);
  }
})();
</script>"#;

#[test]
fn shaders_compile_in_tint() {
    let (variants, count) = tried();
    let wgsl = |(variant, tuning): &(_, _)| write_wgsl("shader", &compose(variant, tuning).unwrap()).unwrap();
    let texts: BTreeSet<String> = variants.par_iter().map(wgsl).collect();
    println!("{} texts of {} variants of {count}", texts.len(), variants.len());
    let texts: Vec<String> = texts.into_iter().collect();
    for part in texts.chunks(MOST_SHADERS) {
        let numbered = part.iter().enumerate().map(|(i, text)| (i.to_string(), text.clone().into_bytes()));
        let files: HashMap<String, Vec<u8>> = numbered.collect();
        let page = PAGE.replace("COUNT", &files.len().to_string());
        let Some(said) = answers(page, &files, WebGpu::SwiftShader) else { return };
        let said = said.values().map(|text| String::from_utf8_lossy(text)).collect::<Vec<_>>();
        assert!(said.is_empty(), "{} of {} shaders fail:\n{}", said.len(), files.len(), said.join("\n"));
    }
}

#[test]
fn a_faulty_shader_is_found() {
    let files = HashMap::from([("0".to_owned(), b"fn broken() -> u32 { return 1.5; }".to_vec())]);
    let Some(said) = answers(PAGE.replace("COUNT", "1"), &files, WebGpu::SwiftShader) else { return };
    assert!(String::from_utf8_lossy(&said["0"]).contains("error in line 1"));
}
